/* The image: the drive's only instance, its interrupts, its background. */
#include "ht_image.h"

#include "ht_drivers.h"
#ifdef HT_XCP
#include "ht_xcp.h"
#endif

#ifndef HT_BOARD
#error "HT_BOARD: name of the board's table, e.g. ht_board_f28335"
#endif
#ifndef HT_CAPTURE_VALUES
#error "HT_CAPTURE_VALUES: 32-bit values of memory for captures"
#endif
#ifndef HT_BUILD
#define HT_BUILD "unknown"
#endif

volatile uint16_t ht_image_start_result = (uint16_t)HT_START_UNDER_WAY;
ht_mailbox ht_image_mailbox;
ht_port ht_image_port;
ht_drive ht_image_drive;
ht_service ht_image_service;
ht_store ht_image_store;
ht_drive_log ht_image_log;
#ifdef HT_XCP
static ht_xcp xcp;
#endif

/* No start clears it: neither the runtime nor, unless the power was off, the boot ROM. */
#ifdef __TMS320C2000__
#pragma NOINIT(ht_image_reset_memory)
#endif
ht_reset_memory ht_image_reset_memory;
static ht_reset reset;

/* For captures: what the linker command file leaves. */
static uint32_t capture_memory[HT_CAPTURE_VALUES];

/* Nothing sensible can be done any more. The gates are off; nobody services the
 * watchdog, so the chip starts again. */
static void give_up(void)
{
    HT_DINT(ht_image_port.io);
    for (;;) {
        HT_IDLE(ht_image_port.io);
    }
}

static HT_INTERRUPT void fast(void)
{
    ht_drive_fast_isr(&ht_image_drive);
    ht_service_fast(&ht_image_service);
#ifdef HT_XCP
    ht_xcp_fast(&xcp);
#endif
}

static HT_INTERRUPT void slow(void)
{
    ht_pie_begin_slow(&ht_image_port);
    ht_drive_slow_isr(&ht_image_drive); /* finds a fast interrupt that is lost: gates off */
    ht_watchdog_first(&ht_image_port);
    ht_pie_end_slow(&ht_image_port);
}

/* The dead-man timer of the F28335 has expired. The slow interrupt tells the cause. */
static HT_INTERRUPT void lost(void)
{
    ht_drive_interrupt_lost(&ht_image_drive);
}

static HT_INTERRUPT void unexpected(void)
{
    ht_port_gates_off(&ht_image_port);
    give_up();
}

void ht_image_start(void)
{
    static const ht_isrs isrs = {fast, slow, lost, unexpected};
    ht_params params;
    ht_service_setup link;
    bool clocked;
    ht_port_bind(&ht_image_port, HT_TARGET_IO, &HT_BOARD);
    HT_DINT(ht_image_port.io);
    clocked = ht_board_start(&ht_image_port);
    reset = ht_reset_count(&ht_image_reset_memory, ht_image_port.reset_cause);
    ht_pie_start(&ht_image_port, &isrs);
    ht_store_none(&ht_image_store);
    (void)ht_image_memory(&ht_image_port, &ht_image_store.port);
    ht_log_none(&ht_image_log);
    (void)ht_image_log_memory(&ht_image_port, &ht_image_log.ring.port);
    ht_params_default(&params);
    if (ht_store_start(&ht_image_store, &ht_image_drive, &ht_image_port, &params) != HT_OK) {
        ht_image_start_result = (uint16_t)HT_START_REFUSED;
        give_up();
    }
    link.device = HT_BOARD.name;
    link.build = HT_BUILD;
    link.watchdog_ms = HT_SERVICE_WATCHDOG_MS;
    link.line = ht_sci_line(&ht_image_port);
#ifdef HT_XCP
    ht_xcp_init(&xcp, &ht_image_service, &link.line, (uint16_t)HT_XCP_SERIAL);
    link.line = ht_xcp_shared(&xcp);
#endif
    link.memory = capture_memory;
    link.memory_size = HT_CAPTURE_VALUES;
    link.store = &ht_image_store;
    link.log = &ht_image_log;
    link.reset = &reset;
    ht_service_init(&ht_image_service, &ht_image_drive, &link);
    ht_image_start_result = (uint16_t)ht_image_port.clock;
    if (clocked) {
        ht_pie_enable(&ht_image_port);
    }
}

/* Without a right clock there is no interrupt, and no reset that would help. */
static void stand_in(void)
{
    ht_drive_stand_in(&ht_image_drive, HT_FAULT_CLOCK);
    ht_watchdog_first(&ht_image_port);
}

static void tell_range(ht_mailbox *box)
{
    ht_range range = ht_param_range(&ht_image_port, box->id);
    box->smallest = range.min;
    box->largest = range.max;
}

static ht_result execute(ht_mailbox *box)
{
    ht_result result = HT_OK;
    switch (box->command) {
    case HT_COMMAND_START:
        result = ht_drive_start(&ht_image_drive);
        break;
    case HT_COMMAND_STOP:
        ht_drive_stop(&ht_image_drive);
        break;
    case HT_COMMAND_CLEAR:
        result = ht_drive_clear(&ht_image_drive);
        break;
    case HT_COMMAND_SET:
        result = ht_drive_set(&ht_image_drive, box->id, box->value);
        tell_range(box);
        break;
    case HT_COMMAND_GET:
        box->value = ht_drive_get(&ht_image_drive, box->id);
        tell_range(box);
        break;
    case HT_COMMAND_SAVE:
        result = ht_service_keep(&ht_image_service);
        break;
    case HT_COMMAND_FORGET:
        result = ht_service_forget(&ht_image_service);
        break;
    default:
        result = HT_ERROR_ID;
        break;
    }
    return result;
}

void ht_image_background(void)
{
    if (ht_image_port.clock != HT_CLOCK_RIGHT) {
        stand_in();
    }
    ht_watchdog_second(&ht_image_port);
    ht_service_turn(&ht_image_service);
#ifdef HT_XCP
    ht_xcp_turn(&xcp);
#endif
    if (ht_image_mailbox.command != (uint16_t)HT_COMMAND_NONE) {
        ht_image_mailbox.result = (uint16_t)execute(&ht_image_mailbox);
        ht_image_mailbox.command = (uint16_t)HT_COMMAND_NONE;
    }
}
