/* The watchdog, the same on both devices. It counts from reset on and is never off:
 * a start that hangs ends in a reset, and a reset leaves all pins inputs. */
#include "ht_drivers.h"

#define WDKEY 0x7025u
#define WDCR 0x7029u
#define WDCR_CHECK 0x0028u /* any other pattern in WDCHK resets the device */
#define WDPS_LONGEST 7u    /* prescaler 2^(WDPS - 1) */
#define KEY_FIRST 0x0055u
#define KEY_SECOND 0x00AAu
#define COUNTS 256.0f
#define SLOW_PERIODS 2.5f

static void prescale(ht_port *port, uint16_t wdps)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, WDKEY, KEY_FIRST);
    HT_WR16(port->io, WDKEY, KEY_SECOND);
    HT_WR16(port->io, WDCR, (uint16_t)(WDCR_CHECK | wdps));
    HT_EDIS(port->io);
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
