/** @file ht_misfit.h
 *  Parameters that do not fit together, and why.
 */
#ifndef HT_MISFIT_H
#define HT_MISFIT_H

#include "ht_params.h"

/** Why parameters do not fit together (ht_misfits.def). */
typedef enum {
    HT_MISFIT_NONE = 0,
#define HT_ORDER(id, less, share, more, touch) HT_MISFIT_##id,
#define HT_RULE(id, first, second, text) HT_MISFIT_##id,
#include "ht_misfits.def"
#undef HT_ORDER
#undef HT_RULE
    HT_MISFITS
} ht_misfit;

/** The subject of a misfit. `share` > 0: parameter `first` must be at most, or without `touch` below,
 *  `share` times parameter `second`. `share` 0: a rule of its own about both. */
typedef struct {
    uint16_t first;
    uint16_t second;
    float share;
    bool touch;
} ht_misfit_info;

/** A time in whole counts, rounded up (HT_DEAD_TOLERANCE_COUNTS). The result must fit into 16 bits. */
uint16_t ht_counts_up(float time_us, float clock_Hz);

/** NULL if there is no such misfit. */
const ht_misfit_info *ht_misfit_describe(uint16_t misfit);

/** Least `vdc_band_V` that the capacitor holds; 0 without a limit or a known capacitor. The largest
 *  power is that of the torque limit where the voltage no longer turns the flux reference; beyond that
 *  speed the torque falls. */
float ht_misfit_band_V(const ht_params *p);

/** Largest rate at which the thermal model changes, 1/s; 0: heat is not watched. */
float ht_misfit_heat_per_s(const ht_params *p);
/** Highest temperature that the readings of a misfit's thermistor must tell. */
float ht_misfit_ntc_degC(const ht_params *p, uint16_t misfit);

/** Least `stop_s`: what a misfit's ramp takes from `speed_trip_rpm` down; 0 without a ramp. */
float ht_misfit_stop_s(const ht_params *p, uint16_t misfit);

/** Least `f_isr_Hz` with which the ripple of interleaved carriers leaves i_trip_A; 0 for other schemes. */
float ht_misfit_ripple_Hz(const ht_params *p);

/** The first misfit of parameters that are each in range. */
ht_misfit ht_misfit_of(const ht_params *p, float pwm_clock_Hz);

#endif
