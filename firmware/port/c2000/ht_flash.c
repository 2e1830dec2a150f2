/* Flash wait states. The drive runs from RAM; the flash serves the start and
 * constants that were left there. These functions must not run from the flash. */
#include "ht_change.h"
#include "ht_drivers.h"

/* F28335 */
#define FOPT 0x0A80u
#define FSTDBYWAIT 0x0A84u
#define FACTIVEWAIT 0x0A85u
#define FBANKWAIT 0x0A86u
#define FOTPWAIT 0x0A87u
#define FOPT_ENPIPE 0x0001u
#define FBANKWAIT_150_MHZ 0x0505u /* paged and random reads: 5 */
#define FOTPWAIT_150_MHZ 0x0008u
#define WAIT_DEFAULT 0x01FFu /* the only value that TI allows */

/* F28377S, bank 0 */
#define FRDCNTL 0x5F800u
#define FBAC 0x5F81Eu
#define FBFALLBACK 0x5F820u
#define FPAC1 0x5F824u
#define FRD_INTF_CTRL 0x5F980u
#define ECC_ENABLE 0x5FB00u
#define PUMPREQUEST 0x50024u
#define PUMP_KEY 0x5A5A0000u
#define PUMP_BANK0 0x00000002u
#define FBAC_VREADST 0x000000FFu
#define FBAC_VREADST_FASTEST 0x00000014u
#define FPAC1_PMPPWR 0x00000001u
#define FBFALLBACK_ACTIVE 0x00000003u
#define PREFETCH_AND_CACHE 0x00000003u
#define FRDCNTL_RWAIT 0x00000F00u
#define FRDCNTL_RWAIT_200_MHZ 0x00000300u
#define ECC_ON 0x0000000Au
#define ECC_OFF 0x00000005u

static void start_flash_f28335(ht_port *port)
{
    HT_EALLOW(port->io);
    HT_WR16(port->io, FOPT, FOPT_ENPIPE);
    HT_WR16(port->io, FBANKWAIT, FBANKWAIT_150_MHZ);
    HT_WR16(port->io, FOTPWAIT, FOTPWAIT_150_MHZ);
    HT_WR16(port->io, FSTDBYWAIT, WAIT_DEFAULT);
    HT_WR16(port->io, FACTIVEWAIT, WAIT_DEFAULT);
    HT_EDIS(port->io);
}

/* The pump is bank 0's; cache and prefetch are off. */
static void take_f28377s(ht_port *port)
{
    HT_WR32(port->io, PUMPREQUEST, PUMP_KEY | PUMP_BANK0);
    ht_change32(port->io, FRD_INTF_CTRL, PREFETCH_AND_CACHE, 0u);
}

static void start_flash_f28377s(ht_port *port)
{
    HT_EALLOW(port->io);
    take_f28377s(port); /* off while wait states change */
    ht_change32(port->io, FBAC, FBAC_VREADST, FBAC_VREADST_FASTEST);
    ht_change32(port->io, FPAC1, 0u, FPAC1_PMPPWR);
    ht_change32(port->io, FBFALLBACK, 0u, FBFALLBACK_ACTIVE);
    ht_change32(port->io, FRDCNTL, FRDCNTL_RWAIT, FRDCNTL_RWAIT_200_MHZ);
    ht_change32(port->io, FRD_INTF_CTRL, 0u, PREFETCH_AND_CACHE);
    HT_WR32(port->io, ECC_ENABLE, ECC_ON);
    HT_WR32(port->io, PUMPREQUEST, PUMP_KEY);
    HT_EDIS(port->io);
}

void ht_flash_start(ht_port *port)
{
    if (port->map->flash_cached) {
        start_flash_f28377s(port);
    } else {
        start_flash_f28335(port);
    }
    HT_SETTLE(port->io); /* the last write is through before anything is fetched */
}

void ht_flash_unchecked(ht_port *port)
{
    if (port->map->flash_cached) {
        HT_EALLOW(port->io);
        take_f28377s(port);
        HT_WR32(port->io, ECC_ENABLE, ECC_OFF);
        HT_EDIS(port->io);
    }
    HT_SETTLE(port->io);
}
