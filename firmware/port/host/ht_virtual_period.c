#include "ht_virtual_period.h"

#include "ht_drivers.h"

void ht_virtual_period(ht_drive *d)
{
    ht_port *port = d->port;
    uint32_t per_count = (uint32_t)(port->map->system_clock_Hz / port->map->pwm_clock_Hz + 0.5f);
    if (ht_regfile_pass(port->io, per_count * d->config->control.period.counts) != 0u) {
        port->io->int13 = 0u;
        ht_drive_interrupt_lost(d); /* as the image's routine does */
    }
    if (port->io->lost == 0u) {
        ht_drive_fast_isr(d);
    }
}
