/** @file ht_drive.h
 *  The drive: what every target runs. Interrupt order, states, protection,
 *  parameters and telemetry around the control core.
 *
 *  States:  IDLE -start-> CALIBRATE -> BUILD -> RUN, any -fault-> FAULT -clear->
 *  IDLE, any but FAULT -stop-> IDLE, RUN -shaft stopped by `motion`-> IDLE.
 *  With `start_mode` = test, CALIBRATE -> TEST -time over->
 *  IDLE instead (ht_excitation.h). The gates are on in BUILD, RUN and TEST only.
 *
 *  Concurrency on a target:
 *  - The fast interrupt may interrupt the slow one. The slow one hands over single floats and
 *    flags: references, the resistances in use, `slow_faults`. Values that it reads from the fast
 *    one may belong to two successive samples.
 *  - Commands come from the background. They write the state in such an order that a fast
 *    interrupt in between cannot switch the gates on: in IDLE and FAULT it latches the trip again.
 *  - A parameter change reaches the interrupts as a whole: the fast one takes it over, and a slow
 *    one that is interrupted by this ends with the parameters that it began with.
 *
 *  The flux reference is `flux_ref_Wb`. It follows the parameter of the same name: over the
 *  build-up in BUILD, by the ramp `flux_ramp_Wb` and field weakening in RUN. `in.flux_ref_Wb` is
 *  the control step's copy.
 */
#ifndef HT_DRIVE_H
#define HT_DRIVE_H

#include "ht_configure.h"
#include "ht_rotor_catch.h"

/** Faults of the slow interrupt that a start finds, too: they are no run's. */
#define HT_LASTING_FAULTS                                                                   \
    (HT_FAULT_WINDING | HT_FAULT_WINDING_OPEN | HT_FAULT_WINDING_SHORT | HT_FAULT_SINK_OPEN \
     | HT_FAULT_SINK_SHORT | HT_FAULT_DEVICE)

/* The number after the last one is how many there are. */
typedef enum {
#define HT_STATE(name, number, text, flags) HT_STATE_##name = (number),
#include "ht_states.def"
#undef HT_STATE
    HT_STATES
} ht_state;

/** The meaning of a state for the drive: bits of its flags (ht_states.def). */
enum { HT_AT_WORK = 1, HT_GATES_ON = 2, HT_CONTROLS = 4, HT_ALL_FLAGS = 7 };

/** Name of a state, "" if there is none. */
const char *ht_state_name(uint16_t state);
/** Its flags. All of them if there is no such state: then the gates may be on. */
uint16_t ht_state_flags(uint16_t state);

/** Largest offset of a current sensor that the calibration accepts, counts of the ADC from its
 *  middle. */
#define HT_OFFSET_MOST_COUNTS 200u

/** A share of the flux that may be there unknown, and does not matter. */
#define HT_FLUX_KNOWN 0.02f

/** Share of the build-up during which the flux is too small for its speed to mean anything. */
#define HT_BUILD_BLIND 0.1f

/** Limits that keep the torque from its reference (channel `limits`). */
enum {
#define HT_LIMIT(name, bit, text, help) HT_LIMIT_##name = (bit),
#include "ht_limits.def"
#undef HT_LIMIT
};
enum {
    HT_LIMITS = 0 /**< how many there are */
#define HT_LIMIT(name, bit, text, help) +1
#include "ht_limits.def"
#undef HT_LIMIT
};

typedef struct {
    uint16_t bit;
    const char *name;
    const char *help;
} ht_limit_info;

/** Table entry, or NULL if there is no such row. */
const ht_limit_info *ht_limit_describe(uint16_t row);

/** The values of the fast interrupt that raised the latest fault. */
typedef struct {
    uint32_t tick;   /**< fast interrupts since init; 0 = no fault yet */
    uint16_t state;  /**< ht_state at the time */
    uint32_t faults; /**< those that this interrupt found */
    uint16_t warnings;
    ht_samples samples;
    ht_control_input in;
    ht_estimate estimate;
    float speed_rpm;
} ht_snapshot;

typedef struct {
    /* What the fast interrupt needs comes first, within reach of one instruction. */
    ht_port *port;
    const ht_drive_config *config;          /**< in force */
    const ht_drive_config *volatile staged; /**< for the next fast interrupt; NULL: none */
    uint32_t tick;                          /**< fast interrupts since init */
    volatile uint32_t taken_tick;  /**< of the first interrupt with the parameters in force */
    volatile uint32_t state_ticks; /**< fast interrupts since the state began */
    volatile uint32_t slow_faults; /**< found by the slow interrupt, for the fast one */
    volatile uint16_t state;       /**< ht_state; the interrupt acts on it */
    volatile uint16_t trips;       /**< by hardware since init, modulo 2^16; the fast interrupt's */
    uint32_t faults;
    uint16_t warnings;
    uint16_t end_counts;   /**< PWM counts from the period's start to the interrupt's end */
    uint16_t off_legs;     /**< legs that stay off while the drive runs, a state word */
    uint16_t rotor_faults; /**< with a d axis: what the encoder's counts say in this period */
    uint16_t vdc_acts;     /**< HT_LIMIT_VDC_...: which limit acted since the last slow interrupt */
    uint16_t limits;       /**< HT_LIMIT_...: which limits act */
    uint16_t stuck_leg;    /**< leg whose sensor and trip latch are checked next */
    uint16_t heat_turn; /**< leg whose squared current is looked at next; from HT_LEGS on: none */
    volatile uint16_t looked;    /**< 1: `look` is there, and none is asked for */
    volatile uint16_t look_wait; /**< turns until it begins */
    uint16_t chops;              /**< HT_OUT_CHOPPER while the chopper is on */
    ht_samples samples;          /**< latest */
    volatile uint32_t position_now;
    float offset_counts[HT_LEGS]; /**< calibrated zero of each current channel */
    float i_per_count;
    float v_per_count;
    float turn_per_count; /**< electrical rad */
    float speed_rpm;
    float vdc_from_rpm;  /**< size of the speed when the dc link came beyond `above_V` */
    float look_above_V;  /**< above it the dc link needs the chopper or a limit, or may */
    float torque_ref_Nm; /**< slow loop to fast loop */
    float flux_ref_Wb;   /**< the flux reference: written by the fast interrupt in
                                    *   BUILD, by the slow one in RUN */
    ht_control_input in; /**< latest measurement; copies of both references */
    ht_control_state control;
    ht_protect_state protect;
    /* Slow interrupt, states and commands. */
    ht_speed_state speed;
    ht_speed_measure_state measured;
    uint32_t position_last;
    uint32_t tick_last; /**< `tick` at the last slow interrupt */
    /* Trips by hardware that count against a start: `trips` - `trips_forgotten`. Times are since the
     * slow interrupt noticed the latest one. */
    volatile uint16_t trips_forgotten;
    uint16_t trips_noticed;
    volatile uint16_t quiet_s;        /**< whole seconds */
    float quiet_part_s;               /**< and the rest */
    float flux_ramp_Wb;               /**< the parameter flux_ref_Wb as it is approached; field
                                    *   weakening goes below */
    float omega_mean_rad_s;           /**< flux speed, slow mean */
    float torque_limit_Nm;            /**< of the torque reference, as it is now */
    float torque_least_Nm;            /**< below 0: the same for a negative one */
    ht_ramp_state ramp;               /**< of the speed reference */
    float stop_ticks;                 /**< slow interrupts since the stop began */
    uint16_t motion;                  /**< as the latest slow interrupt found it */
    uint16_t heat_warnings;           /**< the slow interrupt's own: it must not write `warnings` */
    ht_set_difference sets;           /**< learnt; a stop does not forget it */
    ht_heat_state heat;               /**< nothing but a reset forgets it */
    float built;                      /**< slow interrupts of a build-up that adapted R_s */
    ht_device_heat_state device_heat; /**< the same */
    float heat_share;                 /**< of the torque limit, that the temperatures leave */
    uint32_t heat_faults;
    uint32_t offset_sum[HT_LEGS];
    uint32_t build_ticks;
    uint16_t calibration_ticks;
    uint16_t off_ticks;    /**< fast interrupts with the gates off, until 0xFFFF of them */
    uint16_t catches;      /**< 1: this build-up catches a turning shaft, or a flux that is left */
    float flux_unknown;    /**< share of the flux reference that the machine may have unknown; with
                                *   magnets 1: so is the rotor's angle */
    uint16_t flux_lowered; /**< 1: less flux, to keep the flux turning */
    ht_excitation_state excitation;
    ht_alignment_state rotor; /**< where there is one: the angle of the d axis, and its alignment */
    ht_least_loss_state least_loss; /**< the flux in RUN */
    float along_A;                  /**< current along the flux at the last slow interrupt */
    ht_short_circuit_state short_circuit;
    ht_rotor_catch_state rotor_catch;
    ht_snapshot snapshot;       /**< of the latest fault; a clear keeps it */
    ht_params params;           /**< the latest that were accepted */
    ht_drive_config configs[2]; /**< the one in force and the next */
    /* Of the slow interrupt, out of the fast one's way. */
    uint32_t limit_from[HT_LIMITS]; /**< tick at which each limit began to act, the latest time */
    uint32_t limit_to[HT_LIMITS];   /**< and at which it was last seen to */
    ht_outputs_state outputs;       /**< a fault closes the brake in the fast one all the same */
    ht_ntc_state ntc[HT_SLOW_CHANNELS]; /**< as the temperatures, kept but for a reset */
    uint16_t
        slow_channel; /**< whose reading comes next; HT_SLOW_CHANNELS: none was asked for yet */
    uint16_t sensors[HT_SLOW_CHANNELS]; /**< ht_ntc: what their latest readings say */
    ht_index_state index;               /**< the slow interrupt's; nothing but a reset forgets it */
    ht_absolute_state absolute;         /**< the same */
    uint16_t torque_limited_by; /**< HT_LIMIT_...: what makes `torque_limit_Nm` what it is */
    ht_flux_brake_state flux_brake;
    ht_look look;         /**< of the fast interrupt for the slow one, which asks for it */
    uint16_t look_turn;   /**< of numbers at random */
    float torque_more_Nm; /**< of `torque_ref_Nm`, for the mean torque; the slow interrupt's */
} ht_drive;

/** Set up a drive with parameters `p` on `port`: idle, gates off. No interrupt
 *  may run it yet. Refuses parameters that are out of range or do not fit together or the hardware;
 *  the hardware is then as it was. */
ht_result ht_drive_init(ht_drive *d, ht_port *port, const ht_params *p);

/** The fast interrupt: sample, protect, control, write. */
void ht_drive_fast_isr(ht_drive *d);

/** The slow interrupt: speed measurement, speed PI, flux reference. */
void ht_drive_slow_isr(ht_drive *d);

/** Commands from the background. A start needs IDLE and motion = follow, and standstill unless the turning
 *  shaft can be caught: not before what flux there may be unknown has decayed, with magnets only where their
 *  angle is known and below their ceiling; a clear needs
 *  FAULT; both are refused while the trip pin is low. After `restart_count` trips by hardware,
 *  each less than `restart_wait_s` after the one before, a start is refused until that time has passed. */
ht_result ht_drive_start(ht_drive *d);
/** Seconds, rounded up, until a start is no longer refused because of trips by hardware; 0: now. */
uint16_t ht_drive_restart_wait(const ht_drive *d);
void ht_drive_stop(ht_drive *d);
/** Warning bits. */
uint16_t ht_drive_warnings(const ht_drive *d);
ht_result ht_drive_clear(ht_drive *d);

/** Take the gates off and latch `bits`, for a fault that other code finds within the fast
 *  interrupt. */
void ht_drive_trip(ht_drive *d, uint32_t bits);
/** For a timer that finds no fast interrupt any more: gates off, but a short circuit stays. */
void ht_drive_interrupt_lost(const ht_drive *d);
/** The same as a trip from outside the fast interrupt, if none is expected any more, or none yet. If one
 *  comes all the same, it finds the drive in FAULT. Also takes over parameters that wait for a fast
 *  interrupt. */
void ht_drive_stand_in(ht_drive *d, uint32_t bits);

/** Change one parameter: range, state and consistency are checked first, and
 *  nothing changes on an error. */
ht_result ht_drive_set(ht_drive *d, uint16_t id, float value);
/** The same for `n` parameters together: all of them or none; of an id that comes twice
 *  the last value counts. On an error of a single one its id is in `*at`, on HT_ERROR_CONFIG
 *  the reason (ht_misfit.h). */
ht_result ht_drive_write(ht_drive *d, const uint16_t *ids, const float *values, uint16_t n,
                         uint16_t *at);
/** Current value; NaN-free. Returns 0 for an unknown id. */
float ht_drive_get(const ht_drive *d, uint16_t id);

/** Temperature of the heat sink, or of the ambient as long as no thermistor tells it. */
float ht_drive_sink_degC(const ht_drive *d);

/** Temperature of the power stage's hottest leg; the heat sink's without a model. */
float ht_drive_device_degC(const ht_drive *d);

/** Where the encoder's zero is, counts within a revolution; below 0: not known. */
float ht_drive_zero_counts(const ht_drive *d);

/** Telemetry channels (ht_channels.def). */
typedef struct {
    const char *name;
    const char *unit;
    const char *help;
} ht_channel_info;

uint16_t ht_channel_count(void);
const ht_channel_info *ht_channel_describe(uint16_t id);
/** One channel; 0 for an unknown id. NaN, as below, for one of the control while it does not run. */
float ht_channel_read(const ht_drive *d, uint16_t id);
/** All channels into `out[0 .. ht_channel_count() - 1]`. */
void ht_channels_read(const ht_drive *d, float *out);

#endif
