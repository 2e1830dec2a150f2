/* Runs a complete C2000 image with a parameter store on the register model through several starts:
 * its own main, the mailbox's commands, TI's flash API in a fake (flash/fake_flash.c). Each run
 * ends when the power fails, and the next one begins at reset with the contents of the flash.
 *
 * Prints what it checks ("check ok NAME" or "check FAILED NAME"). Exit status 0 if all is well.
 */
#include <setjmp.h>
#include <stdio.h>
#include <string.h>

#include "fake_flash.h"
#include "ht_image.h"

int ht_target_main(void);

ht_regfile ht_image_registers;

/* Symbols that the linker would provide: see main.c. The sizes are on the command line. */
const uint16_t ht_code_load[64] = {1};
uint16_t ht_code_run[64];
const uint16_t ht_const_load[32] = {2};
uint16_t ht_const_run[32];

static jmp_buf power_off;
static int failures;
static void (*life)(void);

static void check(const char *name, int good)
{
    printf("check %s %s\n", good ? "ok" : "FAILED", name);
    failures += good ? 0 : 1;
}

/* The background's first turn is over. */
static void idle(ht_regfile *rf)
{
    (void)rf;
    if (ht_image_drive.port == NULL) {
        check("chip and drive start", 0);
    } else {
        life();
        check("no forbidden access", ht_image_registers.violations == 0u);
        check("no reset by the watchdog", ht_image_registers.dog_resets == 0u);
    }
    longjmp(power_off, 1);
}

static void power_on(const char *what, void (*then)(void))
{
    static volatile int lives;
    extern const ht_board HT_BOARD_UNDER_TEST;
    printf("life %d: %s\n", lives, what);
    lives++;
    memset(&ht_image_drive, 0, sizeof ht_image_drive);
    memset(&ht_image_mailbox, 0, sizeof ht_image_mailbox);
    memset(&ht_image_store, 0, sizeof ht_image_store);
    memset(&ht_image_log, 0, sizeof ht_image_log);
    ht_regfile_reset(&ht_image_registers, HT_BOARD_UNDER_TEST.map);
    ht_image_registers.idle = idle;
    fake_flash_chip = &ht_image_registers;
    fake_flash_port = &ht_image_port;
    life = then;
    if (setjmp(power_off) == 0) {
        (void)ht_target_main();
    }
    check("the API's rules are kept", fake_flash_broken == 0u);
    if (fake_flash_broken != 0u) {
        printf("%s\n", fake_flash_rule);
    }
}

/* --- the world ------------------------------------------------------------------------------ */

static void sample(void)
{
    const ht_c2000_map *m = ht_image_port.map;
    unsigned k;
    for (k = 0; k < 7; k++) {
        ht_image_registers.word[m->adc_result[k]] = (uint16_t)(2048u << m->adc_shift);
    }
}

static void slow_period(void)
{
    unsigned n;
    for (n = 0; n < 100; n++) {
        sample();
        (void)ht_regfile_period(&ht_image_registers);
        ht_regfile_wait(&ht_image_registers, 100);
    }
    (void)ht_regfile_timer(&ht_image_registers);
    ht_image_background();
}

static ht_result command(uint16_t what)
{
    ht_image_mailbox.command = what;
    ht_image_background();
    return (ht_result)ht_image_mailbox.result;
}

static ht_result set(uint16_t id, float value)
{
    ht_image_mailbox.id = id;
    ht_image_mailbox.value = value;
    return command(HT_COMMAND_SET);
}

static float get(uint16_t id)
{
    return ht_drive_get(&ht_image_drive, id);
}

static float initial(uint16_t id)
{
    return ht_param_describe(id)->initial;
}

/* --- the lives ------------------------------------------------------------------------------- */

static void runs_on(void)
{
    uint32_t tick = ht_image_drive.tick;
    slow_period();
    check("interrupts arrive", ht_image_drive.tick == tick + 100u);
    check("interrupts are let through", ht_image_registers.intm == 0u);
}

static void first(void)
{
    uint32_t tick;
    check("nothing is stored", ht_image_store.set == (uint16_t)HT_SET_DEFAULTS);
    check("gates are off", ht_port_tripped(&ht_image_port, HT_ALL_LEGS));
    runs_on();
    check("a parameter is set", set(HT_P_rs_ohm, 1.7f) == HT_OK);
    check("another is set", set(HT_P_dead_time_us, 3.0f) == HT_OK);
    check("a reference is set", set(HT_P_speed_ref_rpm, 300.0f) == HT_OK);
    runs_on();
    tick = ht_image_drive.tick;
    fake_flash_slow = true;
    ht_image_registers.word[0x0C00] = 5u; /* the slow interrupt's timer is about to reach 0 */
    check("it is kept", command(HT_COMMAND_SAVE) == HT_OK);
    check("the slow interrupt's period begins anew",
          ht_image_registers.word[0x0C00] == ht_image_registers.word[0x0C02]);
    check("that takes time", ht_image_registers.time_us > 100000u);
    check("the tick stands still", ht_image_drive.tick - tick <= 1u);
    check("no fault comes of it",
          (ht_image_drive.faults == 0u) && (ht_image_drive.state == (uint16_t)HT_STATE_IDLE));
    check("gates stay off", ht_port_tripped(&ht_image_port, HT_ALL_LEGS));
    runs_on();
    check("no fault comes after it", ht_image_drive.faults == 0u);
}

static void refused_while_running(void)
{
    unsigned n;
    check("the saved set is in force", ht_image_store.set == (uint16_t)HT_SET_SAVED);
    check("with its values", (get(HT_P_rs_ohm) == 1.7f) && (get(HT_P_dead_time_us) == 3.0f));
    check("the reference is not kept", get(HT_P_speed_ref_rpm) == 0.0f);
    check("gates are off", ht_port_tripped(&ht_image_port, HT_ALL_LEGS));
    (void)set(HT_P_encoder_trip_rpm, 0.0f); /* no machine is connected */
    (void)set(HT_P_flux_check, 0.0f);
    (void)set(HT_P_stuck_trip_A, 0.0f);
    (void)set(HT_P_loss_check, 0.0f);
    (void)set(HT_P_flux_trip_Wb, 100.0f);
    runs_on();
    check("start is accepted", command(HT_COMMAND_START) == HT_OK);
    for (n = 0; n < 60; n++) {
        uint16_t state = ht_image_drive.state;
        bench.operations = 0;
        if ((state != (uint16_t)HT_STATE_IDLE) && (state != (uint16_t)HT_STATE_FAULT)) {
            check("no save while it runs", command(HT_COMMAND_SAVE) == HT_ERROR_STATE);
            check("no forget while it runs", command(HT_COMMAND_FORGET) == HT_ERROR_STATE);
            check("the flash is left alone", bench.operations == 0u);
        }
        slow_period();
    }
    check("drive runs", ht_image_drive.state == (uint16_t)HT_STATE_RUN);
    ht_regfile_pin(&ht_image_registers, ht_image_port.board->trip.gpio, 0u);
    slow_period();
    check("a fault", ht_image_drive.state == (uint16_t)HT_STATE_FAULT);
    (void)set(HT_P_rs_ohm, 1.8f);
    check("kept in fault", command(HT_COMMAND_SAVE) == HT_OK);
    check("the fault stays", ht_image_drive.faults == (uint16_t)HT_FAULT_EXTERNAL);
}

static void one_copy_is_damaged(void)
{
    check("the other copy is in force", ht_image_store.set == (uint16_t)HT_SET_SAVED);
    check("with the latest values", get(HT_P_rs_ohm) == 1.8f);
}

static void both_are_damaged(void)
{
    uint16_t id;
    int good = 1;
    check("damage is told", ht_image_store.set == (uint16_t)HT_SET_DAMAGED);
    for (id = 0; id < ht_param_count(); id++) {
        good = good && (get(id) == initial(id));
    }
    check("the defaults stand", good);
    check("gates are off", ht_port_tripped(&ht_image_port, HT_ALL_LEGS));
    runs_on();
    check("forgotten", command(HT_COMMAND_FORGET) == HT_OK);
}

static void nothing_again(void)
{
    check("nothing is stored", ht_image_store.set == (uint16_t)HT_SET_DEFAULTS);
    check("the defaults stand", get(HT_P_rs_ohm) == initial(HT_P_rs_ohm));
}

/* The log reads its sectors in turns of the background, and writes what waits. */
static void the_log(uint16_t events)
{
    unsigned n;
    for (n = 0; n < 3000; n++) {
        ht_image_background();
    }
    check("the log has a memory that works", ht_log_keeps(&ht_image_log));
    check("no slot is damaged", ht_image_log.ring.damaged == 0u);
    check("every start is in it", ht_log_events(&ht_image_log) == events);
    check("nothing waits", ht_image_log.waiting == 0u);
    check("interrupts are let through", ht_image_registers.intm == 0u);
    check("gates are off", ht_port_tripped(&ht_image_port, HT_ALL_LEGS));
}

static void a_first_log(void)
{
    the_log(1);
}

static void the_log_is_kept(void)
{
    the_log(2);
}

int main(void)
{
    bench_erase();
    power_on("as it comes from the factory", first);
    fake_flash_slow = false;
    power_on("with a saved set", refused_while_running);
    *bench_word(0, 25) ^= 0x10u;
    power_on("one copy is damaged", one_copy_is_damaged);
    *bench_word(1, 40) ^= 0x200u;
    power_on("both copies are damaged", both_are_damaged);
    power_on("forgotten", nothing_again);
    power_on("its log begins", a_first_log);
    power_on("its log goes on", the_log_is_kept);
    check("nothing else of the flash is touched", fake_flash_rest_is_untouched());
    return (failures == 0) ? 0 : 1;
}
