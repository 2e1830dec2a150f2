/** @file ht_excitation.h
 *  Test excitation: the voltages of the state TEST, by which a host measures the machine.
 *
 *  It is a voltage and no current loop, because it also finds wrong wiring: a loop around a sensor
 *  with the wrong sign would run away. Every leg has one pulse per period, centred in it (under
 *  immediate load: in what is left of it). The currents of a sample, taken between two pulses, are
 *  then the means of their ripple.
 *
 *  The voltage vector (alpha, beta, x, y) follows a wave that begins with the WRITE that asks for
 *  it: until a WRITE has come in the state TEST the voltage is zero, whatever the parameters say.
 */
#ifndef HT_EXCITATION_H
#define HT_EXCITATION_H

#include "ht_params.h"
#include "ht_pattern.h"

/** The effect of the wave on the vector. */
typedef enum {
    HT_WAVE_SQUARE = 0,    /**< changes its sign; at 0 Hz it is constant */
    HT_WAVE_SQUARE_AB = 1, /**< changes the sign of alpha-beta; x-y stays */
    HT_WAVE_SQUARE_XY = 2, /**< changes the sign of x-y; alpha-beta stays */
    HT_WAVE_ROTATE = 3     /**< rotates alpha-beta; x-y stays */
} ht_wave;

typedef struct {
    ht_winding winding;
    ht_wave wave;
    ht_ab ab_V;
    ht_xy xy_V;
    float turn_cos; /**< angle of the wave from one sample to the next */
    float turn_sin;
    float current_A;     /**< limit, any phase */
    float travel_counts; /**< limit of the shaft's movement, either way */
    uint32_t ticks;      /**< fast interrupts until the test ends by itself */
} ht_excitation_config;

typedef struct {
    bool on;        /**< a WRITE has asked for the voltages since the state began */
    float wave_cos; /**< the wave's angle, 0 at its begin */
    float wave_sin;
    float rest[HT_LEGS]; /**< of a count, for the next pulse: its length is whole counts, but direct
                          *   voltages must be right in the mean */
    uint32_t position;   /**< of the shaft when the state began */
} ht_excitation_state;

void ht_excitation_configure(const ht_params *p, ht_excitation_config *c);

/** The state TEST begins: no voltage yet. */
void ht_excitation_reset(ht_excitation_state *st, uint32_t position);

/** A WRITE: the wave begins. */
void ht_excitation_begin(ht_excitation_state *st);

/** Faults of a sample: a current or the shaft's movement beyond its limit. */
uint16_t ht_excitation_faults(const ht_excitation_config *c, const ht_excitation_state *st,
                              const ht_six *i_A, uint32_t position);

/** The next period's pattern. Voltages beyond the dc link's are cut. */
void ht_excitation_step(const ht_excitation_config *c, ht_excitation_state *st, float vdc_V,
                        const ht_period *period, ht_compare *out);

#endif
