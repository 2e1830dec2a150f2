/* The watchdog, the same on both devices. It counts from reset on and is never off:
 * a start that hangs ends in a reset, and a reset leaves all pins inputs. */
#include "ht_drivers.h"
#include "ht_reset.h"

#define WDKEY 0x7025u
#define WDCR 0x7029u
#define WDCR_CHECK 0x0028u /* any other pattern in WDCHK resets the device */
#define WDCR_FLAG 0x0080u  /* F28335: its reset came last; a one clears it */
#define WDPS_LONGEST 7u    /* prescaler 2^(WDPS - 1) */
#define KEY_FIRST 0x0055u
#define KEY_SECOND 0x00AAu
#define COUNTS 256.0f
#define SLOW_PERIODS 2.5f

/* RESC: ones clear. The other flags are of no use here. */
#define RESC_POWER 0x00000001u
#define RESC_PIN 0x00000002u
#define RESC_WATCHDOG 0x00000004u
#define RESC_NMI 0x00000008u
#define RESC_OTHER 0x00000160u /* self-test, hibernation, code security */
#define RESC_FLAGS (RESC_POWER | RESC_PIN | RESC_WATCHDOG | RESC_NMI | RESC_OTHER)

static void prescale(ht_port *port, uint16_t wdps)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, WDKEY, KEY_FIRST);
    HT_WR16(port->io, WDKEY, KEY_SECOND);
    HT_WR16(port->io, WDCR, (uint16_t)(WDCR_CHECK | wdps));
    HT_EDIS(port->io);
}

static uint16_t of_resc(uint32_t flags)
{
    static const struct {
        uint32_t flag;
        uint16_t cause;
    } rows[] = {
        {RESC_NMI, HT_RESET_NMI},     {RESC_WATCHDOG, HT_RESET_WATCHDOG},
        {RESC_OTHER, HT_RESET_OTHER}, {RESC_POWER, HT_RESET_POWER},
        {RESC_PIN, HT_RESET_PIN},
    };
    uint16_t k;
    for (k = 0u; k < (uint16_t)(sizeof(rows) / sizeof(rows[0])); k++) {
        if ((flags & rows[k].flag) != 0u) {
            return rows[k].cause;
        }
    }
    return (uint16_t)HT_RESET_NO_FLAG;
}

uint16_t ht_watchdog_cause(ht_port *port)
{
    uint32_t at = port->map->reset_cause;
    uint32_t flags;
    if (at == 0u) {
        bool dog = (HT_RD16(port->io, WDCR) & WDCR_FLAG) != 0u;
        prescale(port, WDCR_FLAG | WDPS_LONGEST);
        return dog ? (uint16_t)HT_RESET_WATCHDOG : (uint16_t)HT_RESET_NO_FLAG;
    }
    flags = HT_RD32(port->io, at) & RESC_FLAGS;
    HT_EALLOW(port->io);
    HT_WR32(port->io, at, flags);
    HT_EDIS(port->io);
    return of_resc(flags);
}

void ht_watchdog_hold(ht_port *port)
{
    prescale(port, WDPS_LONGEST);
}

void ht_watchdog_start(ht_port *port, float slow_Hz)
{
    float slow_periods = COUNTS / port->map->watchdog_Hz * slow_Hz;
    uint16_t wdps = 1u;
    bool short_of = slow_periods < SLOW_PERIODS;
    while (short_of && (wdps < WDPS_LONGEST)) {
        slow_periods = 2.0f * slow_periods;
        short_of = slow_periods < SLOW_PERIODS;
        wdps++;
    }
    prescale(port, wdps);
}

void ht_watchdog_first(ht_port *port)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, WDKEY, KEY_FIRST);
    HT_EDIS(port->io);
}

void ht_watchdog_second(ht_port *port)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, WDKEY, KEY_SECOND);
    HT_EDIS(port->io);
}
