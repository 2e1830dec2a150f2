/** @file ht_control.h
 *  The control law: one `step` per sampling period. The table law follows the papers'
 *  block diagrams (paper A, Fig. 4; paper B, Figs. 3 and 5):
 *
 *    currents, Vdc -> observer -> (prediction) -> comparators -> switching table
 *      -> scheme -> (x-y regulator -> duties) -> compare registers
 *
 *  and the laws that command a voltage:
 *
 *    currents, Vdc -> observer -> prediction -> flux or current, x-y regulator -> voltage
 *      -> modulator -> compare registers
 *
 *  A law that makes the pattern itself has no modulator. ht_laws.def lists the laws.
 *
 *  The caller owns config and state; any number of drives can live side by side.
 *  `step` cannot fail: every input, NaN and infinity included, gives a pattern
 *  that the PWM can realise; whether the gates stay on is the caller's decision.
 */
#ifndef HT_CONTROL_H
#define HT_CONTROL_H

#include "ht_catch.h"
#include "ht_deadbeat_law.h"
#include "ht_foc_law.h"
#include "ht_interleaved_law.h"
#include "ht_leg_loss.h"
#include "ht_lost_legs.h"
#include "ht_modulator.h"
#include "ht_table_law.h"

typedef struct {
    ht_scheme scheme;
    ht_law law;    /**< of the scheme */
    bool shadow;   /**< a pattern takes effect one period after its step */
    bool predict;  /**< decide on the state one period ahead */
    bool needs_xy; /**< the law decides by the x-y flux */
    bool
        special; /**< another rotor than HT_ROTOR_PLAIN, sets that are not 30 degrees apart, or a law that makes patterns */
    bool only_v0;          /**< zero vectors: V0 only, else the one with the fewest transitions */
    float drop_V;          /**< threshold voltage of switches and diodes, their mean; 0 = ideal */
    float build_current_A; /**< current limit of the flux build-up */
    ht_period period;
    ht_dead_time dead;
    ht_observer_config observer;
/* <law>_law: that of `law` is used, the others may hold anything. */
#define HT_VECTOR_LAW(id, law) ht_##law##_law_config law##_law;
#define HT_VOLTAGE_LAW HT_VECTOR_LAW
#define HT_PATTERN_LAW(id, law)
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    ht_modulator_config modulator; /**< of a voltage law, and of every law without legs */
    ht_leg_loss_config leg_loss;
    bool patterns; /**< the law decides on the pattern itself */
/* At the end: an instruction reaches only so far, and the others keep their places. */
#define HT_VECTOR_LAW(id, law)
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW(id, law) ht_##law##_law_config law##_law;
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
} ht_control_config;

typedef enum {
    HT_CONFIG_OK = 0,
    HT_CONFIG_SCHEME = 1,  /**< scheme, or what its law is configured to: levels, gains, limits */
    HT_CONFIG_TIMING = 2,  /**< period, write instant, pulse, dead time or sampling period */
    HT_CONFIG_MACHINE = 3, /**< resistance or inductance */
    HT_CONFIG_PREDICTION = 4, /**< the law needs shadow load and prediction */
    HT_CONFIG_SAMPLING = 5,   /**< the law needs more samples per time constant of the machine */
    HT_CONFIG_LAW = 6         /**< there is no such law */
} ht_config_status;

typedef struct {
    ht_observer_state observer;
    ht_carry carry;
    ht_applied active;    /**< on the legs during the period that just ended */
    ht_applied next;      /**< shadow load: on the legs from this sample on */
    ht_six i_A;           /**< phase currents of the latest sample */
    ht_flow flow;         /**< where these flow */
    ht_estimate estimate; /**< at the latest sample */
    ht_estimate decided;  /**< the law's input (at the latest sample or one period later) */
    ht_xy i_xy_A;         /**< of the latest sample */
    ht_xy psi_xy_Wb;      /**< x-y flux decided on: laws that need it only */
    ht_ab rotor_Wb;       /**< rotor flux decided on, where the kind of rotor keeps it */
    ht_xy emf_V;     /**< induced in x-y in the period that is decided on, where the rotor does */
    ht_xy v_xy_pu;   /**< x-y command, units of Vdc */
    uint16_t sector; /**< of the flux decided on, 0..11 */
/* <law>_law */
#define HT_VECTOR_LAW(id, law) ht_##law##_law_state law##_law;
#define HT_VOLTAGE_LAW HT_VECTOR_LAW
#define HT_PATTERN_LAW(id, law)
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    ht_modulator_state modulator;
    ht_toggles toggles[2]; /**< of `active` and `next`, where they are modulated */
    ht_leg_loss_state leg_loss;
    ht_lost_legs lost;
    ht_catch_state caught;
/* At the end: an instruction reaches only so far, and the others keep their places. */
#define HT_VECTOR_LAW(id, law)
#define HT_VOLTAGE_LAW(id, law)
#define HT_PATTERN_LAW(id, law) ht_##law##_law_state law##_law;
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
} ht_control_state;

typedef struct {
    ht_six i_A;
    float vdc_V;
    float torque_ref_Nm;
    float flux_ref_Wb;
    float turn_rad;      /**< electrical angle the rotor turned since the last sample */
    float omega_rad_s;   /**< electrical speed of the rotor, to catch or align it */
    ht_ab axis;          /**< d axis of a rotor that has one */
    float inv_flux_ref2; /**< 1 / flux_ref_Wb^2, prepared by the slow loop */
} ht_control_input;

/** Choose a scheme: fills in what its row decides (ht_schemes.def). The rest of `cfg` stays. */
void ht_control_select(ht_control_config *cfg, ht_scheme scheme);

/** Configure the law of the scheme in use, the modulator and `special`. `given->machine` is `cfg->observer`, which
 *  must be set; `given->scheme` is the row of `cfg->scheme`. */
void ht_control_configure(ht_control_config *cfg, const ht_law_setting *given);

/** Largest mean voltage of the scheme, units of Vdc, of a configuration that is checked. */
float ht_control_reach_pu(const ht_control_config *cfg);

/** The same of a drive without some of its legs: a set that has all of its own must make it. */
float ht_control_left_pu(const ht_control_config *cfg);

/** Check a configuration; `ht_control_step` relies on it. */
ht_config_status ht_control_check(const ht_control_config *cfg);

/** Demagnetised machine, currents `i_A`, all legs low. */
void ht_control_reset(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A);

/** Continue under `cfg` with a state from another configuration, `from`: a law that takes over from
 *  another one begins with its state reset. Machine, pattern and, where the law remains, its state
 *  stay as they are. */
void ht_control_switch_over(const ht_control_config *from, const ht_control_config *cfg,
                            ht_control_state *st);

/** The pattern that `ht_control_reset` assumes on the legs: all low. */
void ht_control_low_pattern(const ht_control_config *cfg, ht_compare *out);

/** True if a drive can go on without a leg: the voltage that the other legs are to make depends on the
 *  machine one period ahead. */
bool ht_control_can_lose(const ht_control_config *cfg);

/** Go on without the legs of the state word `legs`, where ht_control_can_lose. Returns those that must
 *  be off from now on, 0 if this cannot be. While one leg is lost, another loss is found as before,
 *  but not named; while two are, it is not found. The flux is corrected by what the voltage was wrong
 *  until a loss was found. What ht_leg_loss has learnt of L_xy stays. `set2_ohm`: resistance of set 2
 *  less the mean of both sets. */
uint16_t ht_control_lose(const ht_control_config *cfg, ht_control_state *st, uint16_t legs,
                         float set2_ohm);

/** One period of the alignment of a rotor with a d axis: direct current of `build_current_A` in `direction`
 *  (ht_twelfth), nothing in x-y. Without some of the legs, what they force on x-y, no leg has more than
 *  `build_current_A`, and `omega_rad_s` of the input must be there. Under shadow load the modulator makes the
 *  voltage that this takes. Under immediate load, which the modulator does not do, it is the zero-mean virtual
 *  vector while the current is below its limit. Nothing is estimated: where the d axis is, is not known. */
void ht_control_align(const ht_control_config *cfg, ht_control_state *st,
                      const ht_control_input *in, unsigned direction, ht_compare *out);

/** Demagnetised machine as ht_control_reset has it, but for the flux and the resistances in use, which go
 *  on: a turning shaft is caught. */
void ht_control_catch_begin(const ht_control_config *cfg, ht_control_state *st, const ht_six *i_A);

/** One period of catching a turning shaft: flux without torque, by every scheme alike. Under shadow load the modulator makes the voltage. Under
 *  immediate load it is the zero-mean virtual vector next to it, or a zero vector. */
void ht_control_catch(const ht_control_config *cfg, ht_control_state *st,
                      const ht_control_input *in, ht_compare *out);

/** One sampling period. `build`: flux build-up at standstill instead of the scheme's law,
 *  the zero-mean virtual vector in direction 0, current limited, until |psi| is at the
 *  reference. */
void ht_control_step(const ht_control_config *cfg, ht_control_state *st, const ht_control_input *in,
                     bool build, ht_compare *out);

#endif
