/* The serial line's watchdog. */
#include "ht_contracts.h"
#include "ht_service_requests.c"
#include "prove.h"

void prove_watchdog_ticks(void)
{
    ht_service l;
    ht_drive d;
    uint32_t ticks;
    float rate_Hz = nondet_float();
    GIVEN((rate_Hz >= 1000.0f) && (rate_Hz <= 50000.0f));
    d.params.v[HT_P_f_isr_Hz] = rate_Hz;
    l.drive = &d;
    l.setup.watchdog_ms = nondet_uint16();
    ticks = ht_service_watchdog_ticks(&l);
    MUST(ticks >= 1u);
    MUST(ticks <= 3277000u); /* 65535 ms at 50 kHz */
}
