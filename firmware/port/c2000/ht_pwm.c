/* ePWM set-up. Register order matters in two places, named below: trip first, and
 * no counter runs (TBCLKSYNC = 0) until all modules are set up. */
#include "ht_cmpss.h"
#include "ht_dead_man.h"

#define NOT_PRESENT 0xFFFFu
#define LEG_U1_BIT 5u /* of a state word */
/* TBCTL: up-count, clock undivided (the reset value halves it) */
#define TBCTL_FREE_RUN 0x8000u
#define TBCTL_SYNCOSEL_CTR0 0x0010u
#define TBCTL_PHSEN 0x0004u
/* The sync signal takes two counts from one module to the others. */
#define SYNC_DELAY_COUNTS 2u
/* CMPCTL: load on counter = 0 is the reset state */
#define CMPCTL_SHDWAMODE_IMMEDIATE 0x0010u
#define CMPCTL_SHDWBMODE_IMMEDIATE 0x0040u
/* AQCTL (type 4): shadow AQCTLA, load on counter = period */
#define AQCTL_SHDWAQAMODE 0x0010u
#define AQCTL_LDAQAMODE_PRD 0x0001u
/* AQCTLA fields: 0 nothing, 1 clear, 2 set, 3 toggle */
#define AQ_ZRO_CLEAR 0x0001u
#define AQ_CAU_TOGGLE 0x0030u
#define AQ_CBU_TOGGLE 0x0300u
/* AQSFRC: one-shot force of output A */
#define AQSFRC_OTSFA 0x0004u
#define AQSFRC_ACTSFA_CLEAR 0x0001u
/* DBCTL: A source for both, both delays on. The upper switch comes on late, the lower one as
 * well. Active high: output B is inverted. Active low: output A is, so that in the dead time
 * both outputs are high. */
#define DBCTL_ACTIVE_HIGH 0x000Bu
#define DBCTL_ACTIVE_LOW 0x0007u
/* TZCTL: what a trip does to both outputs */
#define TZCTL_BOTH_LOW 0x000Au
#define TZCTL_BOTH_HIGH 0x0005u
/* ... where the lower switch, output B, is to be on and the upper one, output A, off */
#define TZCTL_A_LOW_B_HIGH 0x0006u
#define TZCTL_A_HIGH_B_LOW 0x0009u
/* ... and the dead-man timer's pulse to output A while it lasts: after reset it would float */
#define TZCTL_DCAEVT1_LOW 0x0020u
#define TZCTL_DCAEVT1_HIGH 0x0010u
/* ... and the comparators' trip to output B */
#define TZCTL_DCBEVT1_LOW 0x0200u
#define TZCTL_DCBEVT1_HIGH 0x0100u
#define TZ_OST 0x0004u
#define TZ_INT 0x0001u
/* GPxDAT: eight words from port to port */
/* Event trigger: every counter = 0 starts a conversion sequence */
#define ETSEL_SOCA_CTR0 0x0900u
#define ETPS_SOCA_EVERY 0x0100u

/* The effect of a trip on the outputs of a leg: both switches off, or in the short circuit the lower one on.
 * The pulse of the dead-man timer and the comparators' trip act on outputs as well; TZA and TZB, which
 * the latch applies, count before them. */
static uint16_t trip_action(const ht_port *port, bool shorted)
{
    bool low = port->board->gates_active_low;
    uint16_t action = low ? TZCTL_BOTH_HIGH : TZCTL_BOTH_LOW;
    if (shorted) {
        action = low ? TZCTL_A_HIGH_B_LOW : TZCTL_A_LOW_B_HIGH;
    }
    if (port->map->ecap != 0u) {
        action |= low ? TZCTL_DCAEVT1_HIGH : TZCTL_DCAEVT1_LOW;
    }
    if (port->map->cmpss != 0u) {
        action |= low ? TZCTL_DCBEVT1_HIGH : TZCTL_DCBEVT1_LOW;
    }
    return action;
}

static void start_module(ht_port *port, uint32_t base, bool first, const ht_pwm_setup *setup)
{
    const ht_c2000_map *m = port->map;
    ht_io *io = port->io;
    uint16_t never = setup->period_counts;
    bool low = port->board->gates_active_low;

    /* Trip first: the switches stay off through everything that follows. */
    HT_EALLOW(io);
    HT_WR16(io, base + m->tzctl, trip_action(port, false));
    HT_WR16(io, base + m->tzfrc, TZ_OST);
    HT_WR16(io, base + m->tzsel, m->one_shot);
    HT_EDIS(io);

    /* ePWM1 sends the sync signal at counter = 0, the others pass it on and follow. */
    HT_WR16(io, base + m->tbctl,
            first ? (TBCTL_FREE_RUN | TBCTL_SYNCOSEL_CTR0) : (TBCTL_FREE_RUN | TBCTL_PHSEN));
    HT_WR16(io, base + m->tbprd, (uint16_t)(setup->period_counts - 1u));
    HT_WR16(io, base + m->tbphs, first ? 0u : SYNC_DELAY_COUNTS);
    HT_WR16(io, base + m->tbctr, 0u);

    HT_WR16(io, base + m->cmpctl,
            setup->shadow ? 0u : (CMPCTL_SHDWAMODE_IMMEDIATE | CMPCTL_SHDWBMODE_IMMEDIATE));
    HT_WR16(io, base + m->cmpa, never);
    HT_WR16(io, base + m->cmpb, never);
    if (m->aqctl != NOT_PRESENT) {
        /* Load on PRD: settled before the ZERO action uses it. */
        HT_WR16(io, base + m->aqctl,
                setup->shadow ? (AQCTL_SHDWAQAMODE | AQCTL_LDAQAMODE_PRD) : 0u);
    }
    HT_WR16(io, base + m->aqctla,
            (uint16_t)(AQ_CAU_TOGGLE | AQ_CBU_TOGGLE | (setup->shadow ? AQ_ZRO_CLEAR : 0u)));
    HT_WR16(io, base + m->aqcsfrc, 0u);

    HT_WR16(io, base + m->dbctl, low ? DBCTL_ACTIVE_LOW : DBCTL_ACTIVE_HIGH);
    HT_WR16(io, base + m->dbred, setup->dead_counts);
    HT_WR16(io, base + m->dbfed, setup->dead_counts);

    if (first) {
        HT_WR16(io, base + m->etps, ETPS_SOCA_EVERY);
        HT_WR16(io, base + m->etsel, ETSEL_SOCA_CTR0);
    }
}

void ht_pwm_start(ht_port *port, const ht_pwm_setup *setup)
{
    uint32_t master = port->map->epwm;
    bool master_is_a_leg = false;
    uint16_t leg;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        bool first = port->leg[leg] == master;
        master_is_a_leg = master_is_a_leg || first;
        start_module(port, port->leg[leg], first, setup);
    }
    if (!master_is_a_leg) { /* its outputs have no pins; it keeps the time */
        start_module(port, master, true, setup);
    }
}

void ht_port_write(ht_port *port, const ht_compare *pattern)
{
    const ht_c2000_map *m = port->map;
    uint32_t cmpa = m->cmpa;
    uint32_t cmpb = m->cmpb;
    /* Shadow load: the start level is the ZERO action of the next period. Immediate
     * load: it is forced now, ZERO does nothing. In both registers 1 clears and 2 sets. */
    uint32_t action = port->shadow ? m->aqctla : m->aqsfrc;
    uint16_t clear = port->shadow ? (AQ_CAU_TOGGLE | AQ_CBU_TOGGLE | AQ_ZRO_CLEAR)
                                  : (AQSFRC_OTSFA | AQSFRC_ACTSFA_CLEAR);
    uint16_t start = pattern->start;
    uint16_t leg;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        uint32_t base = port->leg[leg];
        uint16_t high = (uint16_t)((uint16_t)(start >> (LEG_U1_BIT - leg)) & 1u);
        HT_WR16(port->io, base + cmpa, pattern->ca[leg]);
        HT_WR16(port->io, base + cmpb, pattern->cb[leg]);
        HT_WR16(port->io, base + action, (uint16_t)(clear + high));
    }
}

uint16_t ht_port_counts(const ht_port *port)
{
    return HT_RD16(port->io, port->counter);
}

/* Latch all legs. First what a latch does: a leg that controls does not mind, and one that is latched
 * already has it at once. */
static void latch(ht_port *port, uint16_t action)
{
    uint16_t leg;
    HT_EALLOW(port->io);
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        HT_WR16(port->io, port->leg[leg] + port->map->tzctl, action);
        HT_WR16(port->io, port->leg[leg] + port->map->tzfrc, TZ_OST);
    }
    HT_EDIS(port->io);
}

void ht_port_gates_off(ht_port *port)
{
    latch(port, trip_action(port, false));
}

void ht_port_short_circuit(ht_port *port)
{
    latch(port, trip_action(port, true));
}

void ht_port_leg_off(ht_port *port, uint16_t leg)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, port->leg[leg] + port->map->tzfrc, TZ_OST);
    HT_EDIS(port->io);
}

/* Is the leg one of `legs`? */
static bool among(uint16_t legs, uint16_t leg)
{
    return ((uint16_t)(legs >> (LEG_U1_BIT - leg)) & 1u) != 0u;
}

bool ht_port_gates_on(ht_port *port, uint16_t legs)
{
    bool allowed = !ht_port_trip_pin_low(port);
    if (allowed) {
        uint16_t leg;
        ht_dead_man_forget(port);
        ht_cmpss_forget(port);
        HT_EALLOW(port->io);
        for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
            if (among(legs, leg)) {
                HT_WR16(port->io, port->leg[leg] + port->map->tzclr, TZ_OST | TZ_INT);
            }
        }
        HT_EDIS(port->io);
    }
    return allowed;
}

bool ht_port_leg_tripped(const ht_port *port, uint16_t leg)
{
    return (HT_RD16(port->io, port->leg[leg] + port->map->tzflg) & TZ_OST) != 0u;
}

bool ht_port_tripped(const ht_port *port, uint16_t legs)
{
    /* Each leg has a latch of its own: a short pulse may reach some of them only. */
    uint16_t flags = 0u;
    uint16_t leg;
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        if (among(legs, leg)) {
            flags = (uint16_t)(flags | HT_RD16(port->io, port->leg[leg] + port->map->tzflg));
        }
    }
    return (flags & TZ_OST) != 0u;
}

bool ht_port_trip_pin_low(const ht_port *port)
{
    /* GPxDAT shows a pin's level whatever its multiplexer makes of it. */
    uint32_t gpio = port->board->trip.gpio;
    uint32_t data = port->map->gpio_data + ((gpio / HT_PORT_PINS) * HT_PORT_WORDS);
    return (HT_RD32(port->io, data) & ((uint32_t)1u << (gpio % HT_PORT_PINS))) == 0u;
}
