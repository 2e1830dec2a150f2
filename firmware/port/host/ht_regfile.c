/* Register model: the rules that hold for every register. */
#include "ht_regfile.h"

#include <stdio.h>
#include <string.h>

#include "../c2000/ht_c2000_map.h"
#include "ht_regfile_model.h"

/* The gate drivers that are connected, unless someone sets `gates_active_low`. */
#ifndef HT_GATES_ACTIVE_LOW
#define HT_GATES_ACTIVE_LOW 0
#endif
#define NOWHERE 0xFFFFFFFFu
#define MAY_READ 0x8000u
#define TZ_OST 0x0004u
#define TZ_INT 0x0001u

/* The store of the words above 0x8000. */
typedef struct {
    uint32_t base;
    uint32_t words;
    uint32_t place;
} window;

static const window windows[] = {
    {0x5D000u, 0x800u, 0x8000u}, /* system control */
    {0x5F800u, 0x400u, 0x8800u}, /* flash */
    {0x50024u, 0x002u, 0x8C00u}, /* flash pump */
    {0x703ACu, 0x010u, 0x8C08u}, /* OTP */
};

static uint32_t place(uint32_t addr)
{
    uint32_t n;
    if (addr < HT_REGFILE_LOW) {
        return addr;
    }
    for (n = 0u; n < (sizeof windows / sizeof windows[0]); n++) {
        if ((addr >= windows[n].base) && (addr < (windows[n].base + windows[n].words))) {
            return windows[n].place + (addr - windows[n].base);
        }
    }
    return NOWHERE;
}

uint16_t *ht_regfile_word(ht_regfile *rf, uint32_t addr)
{
    uint32_t at = place(addr);
    return (at == NOWHERE) ? 0 : &rf->word[at];
}

uint32_t ht_regfile_absolute(const ht_regfile *rf)
{
    const uint16_t *w = &rf->word[HT_REGFILE_ABSOLUTE];
    return (w[0] | ((uint32_t)w[1] << 16)) - 1u;
}

static const ht_bound *bound_at(const ht_regfile *rf, uint32_t addr)
{
    uint32_t at = place(addr);
    uint16_t index = (at == NOWHERE) ? 0u : (uint16_t)(rf->index[at] & (uint16_t)~MAY_READ);
    return (index == 0u) ? 0 : &rf->bound[index - 1u];
}

uint32_t ht_model_peek(ht_regfile *rf, uint32_t addr, uint16_t bits)
{
    const uint16_t *w = ht_regfile_word(rf, addr);
    uint32_t value = w[0];
    return (bits == 32u) ? (value | ((uint32_t)w[1] << 16)) : value;
}

void ht_model_poke(ht_regfile *rf, uint32_t addr, uint16_t bits, uint32_t value)
{
    uint16_t *w = ht_regfile_word(rf, addr);
    w[0] = (uint16_t)(value & 0xFFFFu);
    if (bits == 32u) {
        w[1] = (uint16_t)(value >> 16);
    }
}

void ht_model_violation(ht_regfile *rf, uint32_t addr, uint32_t value, uint16_t kind,
                        const char *why)
{
    if (rf->violations == 0u) {
        rf->first_address = addr;
        rf->first_kind = kind;
    }
    if (rf->violations < HT_REGFILE_LOG) {
        ht_violation *entry = &rf->log[rf->violations];
        entry->address = addr;
        entry->value = value;
        entry->kind = kind;
        entry->why = why;
    }
    rf->violations++;
}

uint16_t ht_model_clocked(const ht_regfile *rf, uint32_t addr)
{
    const ht_bound *b = bound_at(rf, addr);
    return (b != 0) ? rf->gate[b->gate].on : 0u;
}

uint16_t ht_model_counting(ht_regfile *rf)
{
    return (uint16_t)((ht_model_peek(rf, rf->chip->sync, 32u) >> rf->chip->sync_bit) & 1u);
}

/* --- tables to places ------------------------------------------------------------ */

static uint16_t gate_of(ht_regfile *rf, uint32_t address, uint16_t bit)
{
    uint16_t n;
    for (n = 0u; n < rf->gate_count; n++) {
        if ((rf->gate[n].address == address) && (rf->gate[n].bit == bit)) {
            return n;
        }
    }
    rf->gate[n].address = address;
    rf->gate[n].bit = bit;
    rf->gate_count++;
    return n;
}

static void bind_register(ht_regfile *rf, const ht_module *m, const ht_register *reg,
                          uint16_t instance, uint16_t gate)
{
    ht_bound *b = &rf->bound[rf->bound_count];
    uint32_t at;
    b->reg = reg;
    b->module = m;
    b->base = m->base + (uint32_t)instance * m->stride;
    b->number = (uint16_t)(m->first + instance);
    b->gate = gate;
    rf->bound_count++;
    at = place(b->base + reg->offset);
    rf->index[at] = rf->bound_count;
    if (reg->bits == 32u) {
        rf->index[at + 1u] = rf->bound_count;
    }
    ht_model_poke(rf, b->base + reg->offset, reg->bits, reg->reset);
}

static const ht_chip *chip_of(const void *map)
{
    static const ht_chip *const chips[HT_DEVICES] = {
#define HT_CHIP(name, family) &ht_chip_##family,
#define HT_CHIP_BOARD(chip, name)
#include "../c2000/ht_chips.def"
#undef HT_CHIP
#undef HT_CHIP_BOARD
    };
    const ht_c2000_map *device = map;
    return chips[device->device];
}

static void bind_module(ht_regfile *rf, const ht_module *m)
{
    uint16_t instance;
    for (instance = 0u; instance < m->count; instance++) {
        uint16_t gate = (m->gate == 0u) ? 0u
                                        : gate_of(rf, m->gate, (uint16_t)(m->gate_bit + instance));
        uint16_t r;
        for (r = 0u; r < m->length; r++) {
            bind_register(rf, m, &m->registers[r], instance, gate);
        }
    }
}

void ht_regfile_reset(ht_regfile *rf, const void *map)
{
    uint16_t n;
    memset(rf, 0, sizeof *rf);
    rf->map = map;
    rf->chip = chip_of(map);
    rf->intm = 1u;
    rf->gates_active_low = HT_GATES_ACTIVE_LOW;
    rf->pll_share = 1.0f;
    rf->gate_count = 1u; /* gate 0: always on */
    for (n = 0u; n < rf->chip->length; n++) {
        bind_module(rf, &rf->chip->modules[n]);
    }
    ht_regfile_settle(rf);
}

void ht_regfile_rebind(ht_regfile *rf, const void *map)
{
    uint16_t bound = 0u;
    uint16_t n;
    rf->map = map;
    rf->chip = chip_of(map);
    for (n = 0u; n < rf->chip->length; n++) {
        const ht_module *m = &rf->chip->modules[n];
        uint16_t instance;
        for (instance = 0u; instance < m->count; instance++) {
            uint16_t r;
            for (r = 0u; r < m->length; r++) {
                rf->bound[bound].module = m;
                rf->bound[bound].reg = &m->registers[r];
                bound++;
            }
        }
    }
}

void ht_regfile_settle(ht_regfile *rf)
{
    uint16_t n;
    rf->gate[0].on = 1u;
    for (n = 1u; n < rf->gate_count; n++) {
        ht_gate *g = &rf->gate[n];
        g->on = (uint16_t)((ht_model_peek(rf, g->address, 32u) >> g->bit) & 1u);
    }
    /* What was open may have lost its clock. */
    memset(rf->open, 0, sizeof rf->open);
    for (n = 0u; n < HT_REGFILE_WORDS; n++) {
        rf->index[n] = (uint16_t)(rf->index[n] & (uint16_t)~MAY_READ);
    }
}

/* --- accesses ---------------------------------------------------------------------- */

/* Every access counts; the planted event arrives in between. */
static void count(ht_regfile *rf)
{
    rf->accesses++;
    if (rf->accesses == rf->event_at) {
        rf->event_at = 0u;
        if (rf->event_timer != 0u) {
            (void)ht_regfile_timer(rf);
        } else {
            ht_regfile_end_of_sequence(rf);
        }
    }
}

/* The register behind an access of this width, or NULL, with a violation. */
static ht_bound *reach(ht_regfile *rf, uint32_t addr, uint32_t value, uint16_t bits)
{
    ht_bound *b = (ht_bound *)bound_at(rf, addr);
    if (b == 0) {
        ht_model_violation(rf, addr, value, HT_REG_HOLE, "");
    } else if ((b->reg->bits != bits) || ((b->base + b->reg->offset) != addr)) {
        ht_model_violation(rf, addr, value, HT_REG_WIDTH, "");
        b = 0;
    } else if (rf->gate[b->gate].on == 0u) {
        ht_model_violation(rf, addr, value, HT_REG_UNCLOCKED, "");
        b = 0;
    } else {
        /* found */
    }
    return b;
}

/* Set-up registers of a PWM module: the effect comes all the same. */
static void check_set_up(ht_regfile *rf, const ht_bound *b, uint32_t addr, uint32_t value)
{
    if (((b->reg->flags & (HT_SET_UP | HT_TRIP_SET_UP)) != 0u) && (ht_model_counting(rf) != 0u)) {
        ht_model_violation(rf, addr, value, HT_REG_ORDER, "the PWM counters run");
    } else if (((b->reg->flags & HT_SET_UP) != 0u)
               && ((ht_model_peek(rf, b->base + rf->chip->tzflg, 16u) & TZ_OST) == 0u)) {
        ht_model_violation(rf, addr, value, HT_REG_ORDER, "the module is not tripped");
    } else if (((b->reg->flags & HT_TRIP_ACTION) != 0u) && (ht_model_counting(rf) != 0u)) {
        ht_model_check_action(rf, b->base, addr, value);
    } else {
        /* fine */
    }
}

/* A command register leaves its mark elsewhere. */
static void set_at(ht_regfile *rf, const ht_bound *b, uint32_t value)
{
    uint32_t at = b->base + b->reg->at;
    ht_model_poke(rf, at, b->reg->bits, value);
    ((ht_bound *)bound_at(rf, at))->written = 1u;
}

static void store(ht_regfile *rf, ht_bound *b, uint32_t addr, uint32_t value)
{
    const ht_register *reg = b->reg;
    uint32_t old = ht_model_peek(rf, addr, reg->bits);
    uint32_t ones = value & reg->writable;
    uint32_t at = b->base + reg->at;
    b->written = 1u;
    switch (reg->what) {
    case HT_ONES_CLEAR:
        ht_model_poke(rf, addr, reg->bits, old & ~ones);
        break;
    case HT_FX_PIEACK:
        rf->acknowledged_at = rf->accesses;
        ht_model_poke(rf, addr, reg->bits, old & ~ones);
        break;
    case HT_FX_ADCINTFLGCLR:
        if (rf->ended_at == rf->accesses) { /* erratum: this clear is lost on the flag */
            rf->word[place(b->base + 5u)] |= (uint16_t)ones; /* ADCINTOVF */
            ones = 0u;
        }
        b->written = 0u;
        set_at(rf, b, ht_model_peek(rf, at, reg->bits) & ~ones);
        break;
    case HT_ONES_CLEAR_AT:
        if (at == (b->base + rf->chip->tzflg)) {
            ht_model_check_clear(rf, b->base, addr, value);
        }
        b->written = 0u;
        set_at(rf, b, ht_model_peek(rf, at, reg->bits) & ~ones);
        break;
    case HT_ONES_SET_AT:
        if ((at == (b->base + rf->chip->tzflg))
            && ((ones & ht_model_peek(rf, b->base + rf->chip->tzeint, 16u)) != 0u)) {
            ones |= TZ_INT; /* a trip that interrupts */
        }
        b->written = 0u;
        set_at(rf, b, ht_model_peek(rf, at, reg->bits) | ones);
        break;
    case HT_PLAIN:
        ht_model_poke(rf, addr, reg->bits, (old & ~reg->writable) | ones);
        break;
    default:
        ht_model_poke(rf, addr, reg->bits, ht_model_written(rf, b, addr, old, value));
        if (reg->what == HT_FX_TSCTR) {
            ht_model_ecap_written(rf);
        }
        break;
    }
}

static void write_checked(ht_regfile *rf, uint32_t addr, uint32_t value, uint16_t bits)
{
    ht_bound *b = reach(rf, addr, value, bits);
    uint32_t reserved;
    if (b == 0) {
        return;
    }
    if (((b->reg->flags & HT_EALLOWED) != 0u) && (rf->eallow == 0u)) {
        ht_model_violation(rf, addr, value, HT_REG_NO_EALLOW, "");
        return;
    }
    if (b->reg->writable == 0u) {
        ht_model_violation(rf, addr, value, HT_REG_READ_ONLY, "");
        return;
    }
    /* A read-modify-write may return what it found. */
    reserved = value & ~b->reg->writable;
    if ((b->reg->what != HT_ONES_CLEAR) && (b->reg->what != HT_FX_PIEACK)) {
        reserved &= ~ht_model_peek(rf, addr, bits);
    }
    if (reserved != 0u) {
        ht_model_violation(rf, addr, value, HT_REG_RESERVED, "");
    }
    check_set_up(rf, b, addr, value);
    store(rf, b, addr, value);
    if ((b->reg->flags & HT_SET_UP) != 0u) {
        ht_model_check_dead_time(rf, b->base, addr, value);
    }
    if ((b->reg->flags & HT_EALLOWED) != 0u) { /* a latch was cleared, a module listens now */
        ht_regfile_pins(rf);
    }
    if ((b->reg->what == HT_PLAIN) && (b->reg->flags == 0u) && (bits == 16u)) {
        rf->open[place(addr)] = (uint16_t)b->reg->writable;
    }
    if (rf->intm == 0u) {
        ht_model_serve(rf);
    }
}

static uint32_t read_checked(ht_regfile *rf, uint32_t addr, uint16_t bits)
{
    const ht_bound *b = reach(rf, addr, 0u, bits);
    if (b == 0) {
        return 0u;
    }
    if ((b->reg->what <= HT_ONES_SET_AT) && (bits == 16u)) {
        rf->index[place(addr)] |= MAY_READ;
    }
    return ht_model_read(rf, b, addr, ht_model_peek(rf, addr, bits));
}

uint16_t ht_regfile_read16(ht_regfile *rf, uint32_t addr)
{
    count(rf);
    if ((addr < HT_REGFILE_LOW) && ((rf->index[addr] & MAY_READ) != 0u)) {
        return rf->word[addr];
    }
    return (uint16_t)read_checked(rf, addr, 16u);
}

void ht_regfile_write16(ht_regfile *rf, uint32_t addr, uint16_t value)
{
    count(rf);
    /* Open bits only: nothing to check, nothing happens. */
    if ((addr < HT_REGFILE_LOW) && (rf->open[addr] != 0u)
        && ((value & (uint16_t)~rf->open[addr]) == 0u)) {
        rf->word[addr] = value;
        return;
    }
    write_checked(rf, addr, value, 16u);
}

uint32_t ht_regfile_read32(ht_regfile *rf, uint32_t addr)
{
    count(rf);
    return read_checked(rf, addr, 32u);
}

void ht_regfile_write32(ht_regfile *rf, uint32_t addr, uint32_t value)
{
    count(rf);
    write_checked(rf, addr, value, 32u);
}

void ht_regfile_nop(ht_regfile *rf)
{
    rf->acknowledged_at = 0u;
}

void ht_regfile_eallow(ht_regfile *rf, uint16_t on)
{
    if ((on != 0u) && (rf->eallow != 0u)) { /* harmless, but someone forgot an EDIS */
        ht_model_violation(rf, 0u, 0u, HT_REG_ORDER, "EALLOW was on already");
    }
    rf->eallow = on;
}

/* --- for tests ----------------------------------------------------------------------- */

uint32_t ht_regfile_address(const ht_regfile *rf, uint16_t n)
{
    return rf->bound[n].base + rf->bound[n].reg->offset;
}

uint32_t ht_regfile_value(ht_regfile *rf, uint16_t n)
{
    return ht_model_peek(rf, ht_regfile_address(rf, n), rf->bound[n].reg->bits);
}

void ht_regfile_name(const ht_regfile *rf, uint32_t addr, char name[HT_REGFILE_LINE])
{
    const ht_bound *b = bound_at(rf, addr);
    name[0] = '\0';
    if (b != 0) {
        const char *dot = (b->reg->name[0] != '\0') ? "." : "";
        if (b->module->count > 1u) {
            (void)snprintf(name, HT_REGFILE_LINE, "%s%u%s%s", b->module->name, (unsigned)b->number,
                           dot, b->reg->name);
        } else {
            (void)snprintf(name, HT_REGFILE_LINE, "%s%s%s", b->module->name, dot, b->reg->name);
        }
    }
}

const char *ht_regfile_kind(uint16_t kind)
{
    static const char *const names[] = {
        "fine",     "no EALLOW", "no such register", "read-only",      "reserved bit", "width",
        "no clock", "order",     "wrong key",        "watchdog reset",
    };
    return names[kind];
}
