#include "ht_c2000_map.h"

const ht_c2000_map ht_f28335 = {
    .device = HT_DEVICE_f28335,
#include "ht_family_f28335.def"
    .pwm_clock_Hz = 150.0e6f,
    .encoder_qualprd = 5u, /* 66.7 ns */
    .system_clock_Hz = 150.0e6f,
    .watchdog_Hz = 58593.75f, /* OSCCLK 30 MHz / 512 */
    .sci_clock_Hz = 75000000u,
};

const ht_c2000_map ht_f28377s = {
    .device = HT_DEVICE_f28377s,
#include "ht_family_f28377s.def"
    .pwm_clock_Hz = 100.0e6f,
    .encoder_qualprd = 7u, /* 70 ns */
    .system_clock_Hz = 200.0e6f,
    .watchdog_Hz = 19531.25f, /* INTOSC1 10 MHz / 512 */
    .sci_clock_Hz = 50000000u,
};
