/* Runs a complete C2000 image on the register model: its own main, from reset through
 * the start of board and drive into the background loop, with both interrupts coming
 * in through the interrupt controller.
 *
 * Prints the registers that the start has written ("register ADDRESS VALUE"), every
 * forbidden access ("violation ADDRESS KIND WHY"), and what it checks ("check ok NAME" or
 * "check FAILED NAME"). Exit status 0 if all is well. tests/firmware/port/test_image.py
 * compares the registers with what they should be, and breaks the drivers to see this fail.
 *
 * An argument plants a fault of the chip's clock: "wrong", "never", "missing", and "late" for a
 * PLL that is right at the second try only. "restart": a debugger halts the chip while the gates
 * are on and lets it go on from its entry, without a reset. "reset FLAGS COUNT CAUSE WATCHDOGS": a
 * start with these flags of the reset, and this count in the memory (-1: what power-on leaves there,
 * -2: a damaged one), tells that cause and count.
 */
#include <setjmp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#define main ht_target_main /* the image's own */
#include "ht_image.h"
#undef main
#include "ht_drivers.h"

#define CODE_WORDS 64
#define CONST_WORDS 32

ht_regfile ht_image_registers;

/* Symbols that the linker would provide: see main.c. The sizes are on the command line. */
const uint16_t ht_code_load[CODE_WORDS + 1] = {1, 2, 3, [CODE_WORDS - 1] = 4, [CODE_WORDS] = 5};
uint16_t ht_code_run[CODE_WORDS + 1];
const uint16_t ht_const_load[CONST_WORDS + 1] = {6, [CONST_WORDS - 1] = 7, [CONST_WORDS] = 8};
uint16_t ht_const_run[CONST_WORDS + 1];

static const char *planted = "";
static long reset_words[4];
static jmp_buf done;
static int failures;
static unsigned turn;
static unsigned fast_per_slow;

static void check(const char *name, int good)
{
    printf("check %s %s\n", good ? "ok" : "FAILED", name);
    failures += good ? 0 : 1;
}

/* --- the world around the chip ---------------------------------------------------------- */

static void sample(unsigned current, unsigned vdc)
{
    const ht_c2000_map *m = ht_image_port.map;
    unsigned k;
    for (k = 0; k < 6; k++) {
        ht_image_registers.word[m->adc_result[k]] = (uint16_t)(current << m->adc_shift);
    }
    ht_image_registers.word[m->adc_result[6]] = (uint16_t)(vdc << m->adc_shift);
}

/* One PWM period of 100 us. */
static void period(void)
{
    (void)ht_regfile_period(&ht_image_registers);
    ht_regfile_wait(&ht_image_registers, 100);
}

/* One slow period. At its end the timer expires, and a fast interrupt comes before the slow one's
 * `within`-th access (0: none). */
static void slow_period(uint32_t within)
{
    unsigned n;
    for (n = 0; n < fast_per_slow; n++) {
        period();
    }
    ht_image_registers.event_at = (within == 0u) ? 0u : ht_image_registers.accesses + within;
    ht_image_registers.stands = 0u; /* the planted one is not `period`'s */
    (void)ht_regfile_timer(&ht_image_registers);
}

static int gates_on(void)
{
    unsigned leg;
    unsigned on = 0;
    for (leg = 0; leg < HT_LEGS; leg++) {
        on += (ht_image_registers.word[ht_image_port.leg[leg] + ht_image_port.map->tzflg] & 4u)
              == 0u;
    }
    check("all legs together", (on == 0) || (on == HT_LEGS));
    return on != 0;
}

static void trip_pin(uint16_t level)
{
    ht_regfile_pin(&ht_image_registers, ht_image_port.board->trip.gpio, level);
}

static void command(uint16_t what)
{
    ht_image_mailbox.command = what;
    ht_image_background();
}

/* A request over the modelled line. Returns the length of the reply in `body`, or 0. */
static uint16_t exchange_with(uint16_t opcode, uint16_t session, uint16_t dictionary,
                              const char *payload, uint16_t length, ht_incoming *body)
{
    static ht_packet request;
    static ht_outgoing out;
    static uint16_t number;
    uint16_t n;
    number++;
    ht_packet_begin(&request);
    ht_packet_add8(&request, opcode);
    ht_packet_add8(&request, (uint16_t)(number & 0xFFu));
    ht_packet_add16(&request, session);
    ht_packet_add16(&request, dictionary);
    for (n = 0; n < length; n++) {
        ht_packet_add8(&request, (uint16_t)payload[n]);
    }
    ht_outgoing_set(&out, &request);
    for (n = 0; n < out.n; n++) {
        check("octet arrives", ht_regfile_sci_arrive(&ht_image_registers, out.octet[n]) == 1u);
        ht_image_background();
    }
    ht_incoming_reset(body);
    for (n = 0; n < 500u; n++) {
        uint16_t octet;
        ht_image_background();
        for (octet = ht_regfile_sci_leave(&ht_image_registers); octet != 0xFFFFu;
             octet = ht_regfile_sci_leave(&ht_image_registers)) {
            if ((ht_incoming_take(body, octet) == HT_INCOMING_WHOLE)
                && (body->octet[0] == (opcode | 0x80u))) {
                return body->n;
            }
        }
    }
    return 0u;
}

static uint16_t exchange(uint16_t opcode, uint16_t session, uint16_t dictionary, ht_incoming *body)
{
    return exchange_with(opcode, session, dictionary, "", 0u, body);
}

/* The same with a session. Returns the status of the reply. */
static unsigned ask(uint16_t opcode)
{
    static ht_incoming body;
    ht_image_service.session = 0x1234u;
    ht_image_service.session_tick = ht_image_drive.tick;
    return (exchange(opcode, 0x1234u, (uint16_t)(ht_image_service.dictionary & 0xFFFFu), &body)
            != 0u)
               ? body.octet[2]
               : 0xFFFFu;
}

static void set(uint16_t id, float value)
{
    ht_image_mailbox.id = id;
    ht_image_mailbox.value = value;
    command(HT_COMMAND_SET);
    check("parameter is set", ht_image_mailbox.result == (uint16_t)HT_OK);
}

/* --- what is to be seen ------------------------------------------------------------------- */

static void show_registers(void)
{
    ht_regfile *rf = &ht_image_registers;
    uint16_t n;
    for (n = 0; n < rf->bound_count; n++) {
        if (rf->bound[n].written != 0u) {
            printf("register %06lX %08lX\n", (unsigned long)ht_regfile_address(rf, n),
                   (unsigned long)ht_regfile_value(rf, n));
        }
    }
}

static void after_start(void)
{
    ht_regfile *rf = &ht_image_registers;
    check("code is copied", memcmp(ht_code_load, ht_code_run, CODE_WORDS * sizeof(uint16_t)) == 0);
    check("constants are copied",
          memcmp(ht_const_load, ht_const_run, CONST_WORDS * sizeof(uint16_t)) == 0);
    check("no more than that is copied",
          (ht_code_run[CODE_WORDS] | ht_const_run[CONST_WORDS]) == 0);
    check("interrupts are let through", (rf->intm == 0u) && (rf->ier == 0x1001u));
    check("gates are off after the start", !gates_on());
    check("start is reported", ht_image_start_result == (uint16_t)HT_START_DONE);
    check("drive is idle", ht_image_drive.state == (uint16_t)HT_STATE_IDLE);
    show_registers();
}

/* A fast interrupt at every place within the slow one. */
static void interrupts(void)
{
    uint32_t within;
    uint32_t accesses = ht_image_registers.accesses;
    (void)ht_regfile_timer(&ht_image_registers);
    accesses = ht_image_registers.accesses - accesses;
    check("slow interrupt is taken", accesses != 0u);
    for (within = 0; within <= accesses; within++) {
        uint32_t fast = ht_image_drive.tick;
        uint32_t wanted = fast_per_slow + ((within != 0u) ? 1u : 0u);
        sample(2048, 2048);
        slow_period(within);
        check("every fast interrupt arrives", ht_image_drive.tick == fast + wanted);
        ht_image_background();
    }
    check("a fast interrupt comes within a slow one", ht_image_registers.deepest == 2u);
    check("interrupts are let through again",
          (ht_image_registers.intm == 0u) && (ht_image_registers.ier == 0x1001u));
}

/* A second timer event within the slow interrupt acts after it. */
static void slow_in_slow(void)
{
    ht_image_registers.deepest = 0u;
    ht_image_registers.event_timer = 1u;
    ht_image_registers.event_at = ht_image_registers.accesses + 5u;
    (void)ht_regfile_timer(&ht_image_registers);
    ht_image_registers.event_timer = 0u;
    check("slow interrupt waits for itself", ht_image_registers.deepest == 1u);
    check("... and finds no fast one in between",
          ht_image_drive.faults == (uint16_t)HT_FAULT_INTERRUPT);
    command(HT_COMMAND_CLEAR);
}

/* Moving encoder: only the slow interrupt turns counts into a speed. */
static void slow_interrupt(void)
{
    unsigned n;
    for (n = 0; n < 3; n++) {
        ht_image_registers.word[ht_image_port.eqep] =
            (uint16_t)(ht_image_registers.word[ht_image_port.eqep] + 400u);
        sample(2048, 2048);
        slow_period(0);
        ht_image_background();
    }
    check("slow interrupt arrives", ht_image_drive.speed_rpm > 100.0f);
    for (n = 0; n < 3; n++) {
        slow_period(0);
        ht_image_background();
    }
    check("slow interrupt keeps arriving", ht_image_drive.speed_rpm == 0.0f);
}

/* A dead time that the board does not allow, from the debugger. */
static void dead_time(float value, float smallest, float largest)
{
    uint16_t at = ht_image_port.leg[5] + ht_image_port.map->dbfed;
    uint16_t before = ht_image_registers.word[at];
    ht_image_mailbox.smallest = 0.0f;
    ht_image_mailbox.largest = 0.0f;
    ht_image_mailbox.id = HT_P_dead_time_us;
    ht_image_mailbox.value = value;
    command(HT_COMMAND_SET);
    check("dead time is refused", ht_image_mailbox.result == (uint16_t)HT_ERROR_VALUE);
    check("... with the allowed range",
          (ht_image_mailbox.smallest == smallest) && (ht_image_mailbox.largest == largest));
    check("... and is as it was", ht_image_registers.word[at] == before);
}

static void dead_times(void)
{
    float largest = (ht_image_port.map->dead_max_counts == 0x3FFu) ? 6.82f : 20.0f;
    dead_time(0.0f, 1.0f, largest);
    dead_time(0.99f, 1.0f, largest);
    dead_time(largest + 0.01f, 1.0f, largest);
    set(HT_P_dead_time_us, 1.0f);
    set(HT_P_dead_time_us, largest);
    set(HT_P_dead_time_us, 2.3f);
}

/* --- the trip pin held low ------------------------------------------------------------- */

static void refused(const char *name)
{
    uint16_t state = ht_image_drive.state;
    command(HT_COMMAND_START);
    check(name, ht_image_mailbox.result == (uint16_t)HT_ERROR_TRIP);
    command(HT_COMMAND_CLEAR);
    check(name, ht_image_mailbox.result == (uint16_t)HT_ERROR_TRIP);
    check(name, ask(HT_OP_START) == (unsigned)HT_ERROR_TRIP);
    check(name, ask(0x0Au) == (unsigned)HT_ERROR_TRIP); /* CLEAR */
    check("... and nothing changes", (ht_image_drive.state == state) && !gates_on());
}

/* Go on to `state`. The gates are off before the build-up. */
static void start_to(uint16_t state)
{
    unsigned n;
    command(HT_COMMAND_START);
    check("start is accepted with the pin high", ht_image_mailbox.result == (uint16_t)HT_OK);
    for (n = 0; (n < 6000u) && (ht_image_drive.state != state); n++) {
        if ((n % fast_per_slow) == 0u) {
            slow_period(0);
        } else {
            period();
        }
        ht_image_background();
    }
    check("state is reached", ht_image_drive.state == state);
}

static void held_low(uint16_t state, unsigned more)
{
    unsigned n;
    start_to(state);
    for (n = 0; n < more; n++) {
        period();
    }
    trip_pin(0u);
    check("a low trip pin switches off", !gates_on());
    for (n = 0; n < 20u; n++) {
        period();
        ht_image_background();
        check("no gate comes on while the trip pin is low", !gates_on());
        check("a low trip pin is the fault",
              (ht_image_drive.state == (uint16_t)HT_STATE_FAULT)
                  && (ht_image_drive.faults == (uint16_t)HT_FAULT_EXTERNAL));
    }
    refused("a low trip pin refuses start and clear in a fault");
    trip_pin(1u);
    command(HT_COMMAND_START);
    check("a fault wants its clear", ht_image_mailbox.result == (uint16_t)HT_ERROR_STATE);
    check("clear is accepted with the pin high", ask(0x0Au) == (unsigned)HT_OK);
    check("a clear switches nothing on", !gates_on());
}

static void trip_pin_held_low(void)
{
    trip_pin(0u);
    refused("a low trip pin refuses a start");
    trip_pin(1u);
    held_low(HT_STATE_CALIBRATE, 3u);
    held_low(HT_STATE_BUILD, 0u); /* before the first interrupt of BUILD */
    held_low(HT_STATE_BUILD, 5u);
    held_low(HT_STATE_RUN, 5u);
}

/* One leg's latch alone. */
static void one_leg_trips(void)
{
    uint16_t *flag = &ht_image_registers.word[ht_image_port.leg[4] + ht_image_port.map->tzflg];
    int n;
    start_to(HT_STATE_RUN);
    *flag = (uint16_t)(*flag | 4u);
    for (n = 0; n < HT_LEGS; n++) { /* each leg is checked in turn */
        period();
    }
    check("one leg's trip is noticed", ht_image_drive.faults == (uint16_t)HT_FAULT_EXTERNAL);
    check("one leg's trip switches all off", !gates_on());
    command(HT_COMMAND_CLEAR);
}

/* If a debugger halts the chip, or its clock fails, the F28377S switches off by itself. */
static void other_trips(void)
{
    int large = ht_image_port.map->device == HT_DEVICE_f28377s;
    start_to(HT_STATE_RUN);
    ht_regfile_emulation_stops(&ht_image_registers);
    check("an emulation stop switches off", gates_on() != large);
    period();
    check("an emulation stop is a fault", (ht_image_drive.faults != 0u) == large);
    command(HT_COMMAND_STOP);
    command(HT_COMMAND_CLEAR);
    start_to(HT_STATE_RUN);
    ht_regfile_clock_fails(&ht_image_registers);
    check("a clock failure switches off", gates_on() != large);
    period();
    check("a clock failure is a fault", (ht_image_drive.faults != 0u) == large);
    command(HT_COMMAND_STOP);
    command(HT_COMMAND_CLEAR);
}

/* No machine is connected, so the checks that need one are off. */
static void without_machine(void)
{
    set(HT_P_restart_count, 0.0f); /* and it trips often */
    set(HT_P_encoder_trip_rpm, 0.0f);
    set(HT_P_flux_check, 0.0f);
    set(HT_P_stuck_trip_A, 0.0f);
    set(HT_P_loss_check, 0.0f);
    set(HT_P_flux_trip_Wb, 100.0f);
}

static void drive(void)
{
    unsigned n;
    uint16_t dead = ht_image_registers.word[ht_image_port.leg[3] + ht_image_port.map->dbred];
    /* A parameter of the PWM: it is set up again between the interrupts. */
    set(HT_P_dead_time_us, 4.6f);
    check("dead time is doubled",
          ht_image_registers.word[ht_image_port.leg[3] + ht_image_port.map->dbred] == 2u * dead);
    check("gates are off after a set-up", !gates_on());
    dead_times();
    without_machine();
    ht_image_mailbox.id = HT_P_flux_trip_Wb;
    command(HT_COMMAND_GET);
    check("parameter is read", ht_image_mailbox.value == 100.0f);
    command(HT_COMMAND_START);
    check("start is accepted", ht_image_mailbox.result == (uint16_t)HT_OK);
    for (n = 0; (n < 60) && (ht_image_drive.state != (uint16_t)HT_STATE_RUN); n++) {
        slow_period(0);
        ht_image_background();
    }
    check("drive runs", ht_image_drive.state == (uint16_t)HT_STATE_RUN);
    check("gates are on", gates_on());
    trip_pin(0u);
    trip_pin(1u);
    check("trip pin switches off by itself", !gates_on());
    period();
    check("trip pin is noticed", ht_image_drive.faults == (uint16_t)HT_FAULT_EXTERNAL);
    command(HT_COMMAND_CLEAR);
    check("fault is cleared", ht_image_drive.state == (uint16_t)HT_STATE_IDLE);
    check("gates stay off after a clear", !gates_on());
    command(HT_COMMAND_START);
    slow_period(0);
    command(HT_COMMAND_STOP);
    check("drive stops", ht_image_drive.state == (uint16_t)HT_STATE_IDLE);
    trip_pin_held_low();
    one_leg_trips();
    other_trips();
    command(HT_COMMAND_SAVE);
    check("an image without a store says so", ht_image_mailbox.result == (uint16_t)HT_ERROR_STORE);
    command(77);
    check("unknown command", ht_image_mailbox.result == (uint16_t)HT_ERROR_ID);
}

static void serial(void)
{
    uint16_t sent[20];
    uint16_t got[20];
    unsigned n;
    for (n = 0; n < 20; n++) {
        sent[n] = (uint16_t)(0x1F0u + n);
    }
    check("transmit FIFO takes 16", ht_sci_write(&ht_image_port, sent, 20) == 16u);
    check("... and no more", ht_sci_write(&ht_image_port, sent, 20) == 0u);
    for (n = 0; n < 16; n++) {
        uint16_t octet = ht_regfile_sci_leave(&ht_image_registers);
        check("octet is sent", octet == (sent[n] & 0xFFu));
        (void)ht_regfile_sci_arrive(&ht_image_registers, octet);
    }
    check("octets arrive", ht_sci_read(&ht_image_port, got, 20) == 16u);
    check("... as sent", (got[0] == 0xF0u) && (got[15] == 0xFFu));
    check("none is left", ht_sci_read(&ht_image_port, got, 20) == 0u);
}

/* The ADC's interrupt stops, but timers and background go on. The gates must go off within three fast
 * periods, long before the slow interrupt comes. That one tells the cause, and the chip must not reset, so that it can report the cause. */
static void lost_interrupt(void)
{
    uint32_t tick;
    unsigned n;
    command(HT_COMMAND_START);
    for (n = 0; (n < 60) && (ht_image_drive.state != (uint16_t)HT_STATE_RUN); n++) {
        slow_period(0);
        ht_image_background();
    }
    check("drive runs again", gates_on());
    period();
    tick = ht_image_drive.tick;
    ht_regfile_wait(&ht_image_registers, 100); /* since the last one: 200 us */
    check("gates are on after two fast periods", gates_on());
    ht_regfile_wait(&ht_image_registers, 100);
    check("gates are off after three fast periods", !gates_on());
    for (n = 0; n < 12; n++) {
        ht_regfile_wait(&ht_image_registers, 10000);
        (void)ht_regfile_timer(&ht_image_registers);
        ht_image_background();
        check("gates stay off", !gates_on());
    }
    check("lost interrupt is named", ht_image_drive.faults == (uint16_t)HT_FAULT_INTERRUPT);
    check("lost interrupt is in the snapshot",
          (ht_image_drive.snapshot.faults == (uint16_t)HT_FAULT_INTERRUPT)
              && (ht_image_drive.snapshot.state == (uint16_t)HT_STATE_RUN)
              && (ht_image_drive.snapshot.tick == tick));
    check("no reset for a lost interrupt", ht_image_registers.dog_resets == 0u);
    set(HT_P_speed_ref_rpm, 10.0f);
    (void)ht_regfile_timer(&ht_image_registers);
    check("a parameter does not wait for it", ht_image_drive.staged == NULL);
    command(HT_COMMAND_CLEAR);
    (void)ht_regfile_timer(&ht_image_registers);
    check("lost interrupt cannot be cleared away",
          (ht_image_drive.faults == (uint16_t)HT_FAULT_INTERRUPT) && !gates_on());
    slow_period(0);
    command(HT_COMMAND_CLEAR);
    slow_period(0);
    check("interrupt that is back", ht_image_drive.state == (uint16_t)HT_STATE_IDLE);
}

/* The interrupt comes back before a slow one has missed it: it finds the cause itself. */
static void lost_for_a_while(void)
{
    start_to(HT_STATE_RUN);
    ht_regfile_wait(&ht_image_registers, 400);
    check("gates are off without interrupts", !gates_on());
    for (unsigned n = 0; n < HT_LEGS; n++) { /* each leg is checked in turn */
        period();
    }
    check("interrupts that come back name the cause",
          ht_image_drive.faults == (uint16_t)HT_FAULT_INTERRUPT);
    command(HT_COMMAND_CLEAR);
    start_to(HT_STATE_RUN);
    check("drive runs after a lost interrupt", gates_on());
    trip_pin(0u);
    trip_pin(1u);
    for (unsigned n = 0; n < HT_LEGS; n++) {
        period();
    }
    check("the next trip has its own cause", ht_image_drive.faults == (uint16_t)HT_FAULT_EXTERNAL);
    command(HT_COMMAND_CLEAR);
}

/* Errata of the F28377S: the end of a conversion in the instant in which the fast interrupt
 * acknowledges the one before. */
static void end_meets_acknowledge(void)
{
    uint32_t tick = ht_image_drive.tick;
    unsigned n;
    ht_image_registers.event_at = ht_image_registers.accesses + 1u;
    for (n = 0; n < 10; n++) {
        period();
    }
    check("interrupts go on after one met its acknowledge",
          (ht_image_drive.tick - tick >= 10u) && (ht_image_registers.event_at == 0u));
    if (ht_image_registers.chip == &ht_chip_f28377s) {
        check("no overflow is left",
              (ht_image_registers.word[0x7403] == 0u) && (ht_image_registers.word[0x7405] == 0u));
    }
}

/* If the interrupts or the background stop, the other must not service the watchdog alone. */
static void watchdog(void)
{
    unsigned n;
    check("watchdog has been serviced", ht_image_registers.dog_resets == 0u);
    for (n = 0; n < 12; n++) { /* the background goes on */
        ht_regfile_wait(&ht_image_registers, 10000);
        ht_image_background();
    }
    check("watchdog bites without the interrupts", ht_image_registers.dog_resets != 0u);
    ht_image_registers.dog_resets = 0u;
    ht_image_registers.dog_us = ht_image_registers.time_us; /* a full time from here on */
    for (n = 0; n < 12; n++) {                              /* both interrupts go on */
        slow_period(0);
    }
    check("watchdog bites without the background", ht_image_registers.dog_resets != 0u);
}

static void show_violations(void)
{
    uint16_t n;
    check("no forbidden access", ht_image_registers.violations == 0u);
    for (n = 0; (n < ht_image_registers.violations) && (n < HT_REGFILE_LOG); n++) {
        char name[HT_REGFILE_LINE];
        const ht_violation *v = &ht_image_registers.log[n];
        ht_regfile_name(&ht_image_registers, v->address, name);
        printf("violation %06lX %s: %s%s%s (%08lX)\n", (unsigned long)v->address, name,
               ht_regfile_kind(v->kind), (v->why[0] != '\0') ? ", " : "", v->why,
               (unsigned long)v->value);
    }
}

/* --- a chip whose clock is not right ------------------------------------------------------ */

/* The reply's head: status, state, faults. */
static void reports_the_clock(const char *name, const ht_incoming *body, uint16_t status)
{
    check(name, (body->octet[2] == status) && (body->octet[3] == (uint16_t)HT_STATE_FAULT)
                    && ((body->octet[4] | (body->octet[5] << 8)) == HT_FAULT_CLOCK));
}

static void no_pin_is_the_pwms(void)
{
    const ht_board *board = ht_image_port.board;
    unsigned n;
    for (n = 0; n < 2u * HT_LEGS; n++) {
        uint32_t gpio = board->pwm[n].gpio;
        uint32_t mux = board->map->gpio + (gpio / 32u) * board->map->gpio_stride + 6u
                       + ((gpio % 32u) / 16u) * 2u + (gpio % 16u) / 8u;
        check("no pin is the PWM's",
              ((ht_image_registers.word[mux] >> (2u * (gpio % 8u))) & 3u) == 0u);
    }
}

static void wrong_clock(void)
{
    static ht_incoming body;
    uint16_t want = (strcmp(planted, "missing") == 0) ? (uint16_t)HT_START_CLOCK_MISSING
                    : (strcmp(planted, "never") == 0) ? (uint16_t)HT_START_NO_LOCK
                                                      : (uint16_t)HT_START_CLOCK_WRONG;
    unsigned n;
    check("start says why", ht_image_start_result == want);
    check("interrupts are not let through", ht_image_registers.intm == 1u);
    no_pin_is_the_pwms();
    for (n = 0; n < 1000; n++) { /* 10 s without a reset, because a reset would not help */
        ht_regfile_wait(&ht_image_registers, 10000);
        ht_image_background();
    }
    check("no resets for ever", ht_image_registers.dog_resets == 0u);
    check("line runs at 115200 baud",
          (ht_sci_baud(&ht_image_port) > 112900.0f) && (ht_sci_baud(&ht_image_port) < 117500.0f));
    check("HELLO is answered", exchange(HT_OP_HELLO, 0u, 0u, &body) != 0u);
    reports_the_clock("HELLO says what is wrong", &body, (uint16_t)HT_OK);
    check("STATUS is answered", exchange(HT_OP_STATUS, 0u, 0u, &body) != 0u);
    reports_the_clock("STATUS says what is wrong", &body, (uint16_t)HT_OK);
    check("STOP is answered", exchange(HT_OP_STOP, 0u, 0u, &body) != 0u);
    set(HT_P_flux_trip_Wb, 100.0f);
    ht_image_background();
    check("a parameter does not wait for an interrupt", ht_image_drive.staged == NULL);
    command(HT_COMMAND_START);
    check("start is refused", ht_image_mailbox.result == (uint16_t)HT_ERROR_STATE);
    command(HT_COMMAND_CLEAR);
    check("clear is refused", ht_image_mailbox.result == (uint16_t)HT_ERROR_STATE);
    check("the fault stays", ht_image_drive.faults == (uint16_t)HT_FAULT_CLOCK);
    no_pin_is_the_pwms();
    show_violations();
}

static void plant(ht_regfile *rf)
{
    rf->wrong_percent = 80u;
    if (strcmp(planted, "wrong") == 0) {
        rf->wrong_locks = 60000u;
    } else if (strcmp(planted, "late") == 0) {
        rf->wrong_locks = (rf->chip == &ht_chip_f28335) ? 1u : 5u; /* locks of one try */
    } else if (strcmp(planted, "never") == 0) {
        rf->never_locks = 1u;
    } else if (strcmp(planted, "missing") == 0) {
        rf->no_crystal = 1u;
        if (rf->chip == &ht_chip_f28335) {
            rf->word[0x7011] |= 8u; /* PLLSTS.MCLKSTS */
        }
    } else {
        /* nothing */
    }
}

/* The register model counts a violation where anything waits, or a clock changes, with a gate on. */
static void restarts(void)
{
    if (turn == 0u) {
        sample(2048, 2048);
        without_machine();
        start_to(HT_STATE_RUN);
        check("gates are on before the restart", gates_on());
        turn++;
        longjmp(done, 2);
    }
    check("gates are off after the restart", !gates_on());
    check("drive is idle after the restart", ht_image_drive.state == (uint16_t)HT_STATE_IDLE);
    show_violations();
    turn = 3u;
    longjmp(done, 1);
}

/* The flags as the boot ROM hands them over. */
static void plant_reset(ht_regfile *rf)
{
    uint16_t flags = (uint16_t)reset_words[0];
    ht_reset_memory *m = &ht_image_reset_memory;
    if (rf->chip == &ht_chip_f28335) {
        *ht_regfile_word(rf, 0x7029u) |= flags; /* WDCR */
    } else {
        *ht_regfile_word(rf, 0x5D380u) = flags; /* RESC */
    }
    memset(m, 0xA5, sizeof *m);
    if (reset_words[1] != -1) {
        (void)ht_reset_count(m, (uint16_t)HT_RESET_POWER); /* 0 */
        m->word |= (uint32_t)reset_words[1] & 0xFFFFu;
        m->inverse = ~m->word ^ ((reset_words[1] < 0) ? 1u : 0u);
    }
}

static void tells_its_reset(void)
{
    static ht_incoming body;
    static ht_packet row;
    const ht_reset_info *info = ht_reset_describe((uint16_t)reset_words[2]);
    uint32_t at = (ht_image_registers.chip == &ht_chip_f28335) ? 0x7029u : 0x5D380u;
    uint16_t flags = (at == 0x7029u) ? 0x80u : 0x16Fu;
    ht_packet_begin(&row);
    ht_packet_add8(&row, 5u); /* docs/protocol.md */
    ht_packet_add16(&row, 0u);
    ht_packet_add8(&row, (uint16_t)reset_words[2]);
    ht_packet_add16(&row, (uint16_t)reset_words[3]);
    ht_packet_add_text(&row, info->name);
    ht_packet_add_text(&row, info->help);
    check("the reset is asked for",
          exchange_with(HT_OP_LIST, 0u, 0u, "\5\0\0", 3u, &body) == 10u + row.n);
    check("the reset is told", memcmp(&body.octet[10], row.octet, row.n * sizeof(uint16_t)) == 0);
    check("its flags are cleared for the next one",
          (*ht_regfile_word(&ht_image_registers, at) & flags) == 0u);
    show_violations();
}

/* Called by the background loop, and by an image that has given up. */
static void idle(ht_regfile *rf)
{
    (void)rf;
    check("chip and drive start", ht_image_drive.port != NULL);
    if (ht_image_drive.port == NULL) {
        show_violations();
        longjmp(done, 1);
    }
    if (strcmp(planted, "restart") == 0) {
        restarts();
    }
    if (strcmp(planted, "reset") == 0) {
        tells_its_reset();
        turn = 3u;
        longjmp(done, 1);
    }
    if ((planted[0] != '\0') && (strcmp(planted, "late") != 0)) {
        wrong_clock();
        turn = 3u;
        longjmp(done, 1);
    }
    if (turn == 0u) {
        after_start();
        interrupts();
        slow_in_slow();
        slow_interrupt();
        drive();
        serial();
        end_meets_acknowledge();
        lost_interrupt();
        lost_for_a_while();
        show_violations();
        watchdog();
    }
    turn++;
    if (turn == 3u) { /* main must run again */
        longjmp(done, 1);
    }
}

int main(int argc, char **argv)
{
    extern const ht_board HT_BOARD_UNDER_TEST;
    fast_per_slow = 100;
    ht_regfile_reset(&ht_image_registers, HT_BOARD_UNDER_TEST.map);
    planted = (argc > 1) ? argv[1] : "";
    plant(&ht_image_registers);
    if (argc == 6) {
        int k;
        for (k = 0; k < 4; k++) {
            reset_words[k] = strtol(argv[2 + k], NULL, 0);
        }
        plant_reset(&ht_image_registers);
    }
    ht_image_registers.idle = idle;
    if (setjmp(done) != 1) { /* 0: from reset, 2: once more */
        (void)ht_target_main();
    }
    check("background loop turns", turn == 3u);
    return (failures == 0) ? 0 : 1;
}
