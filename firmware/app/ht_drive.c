/* The fast interrupt: measurement, checks, and one period of each state. */
#include "ht_angle.h"
#include "ht_drive_inside.h"
#include "ht_limited.h"
#include "ht_rotor_rules.h"
#include "ht_vsd.h"
#include "ht_winding.h"

#include <math.h>
#include <stddef.h>

/* No shaft turns further than this in a period (electrical angle). A position counter that jumps
 * must not make the rotor flux grow without bound; finding the jump is the protection's task. */
#define TURN_MAX_RAD 1.5f

#define TURNS_PER_RAD 0.159154943f

void ht_drive_set_levels(ht_drive *d)
{
    ht_trip_levels levels;
    float above = d->config->params.v[HT_P_comparator_above_pu] * (float)HT_ADC_MID;
    float span = (d->config->protect.i_trip_A / d->i_per_count) + above;
    float vdc = (d->config->protect.vdc_max_V / d->v_per_count) + above + 1.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float low = d->offset_counts[leg] - span;
        levels.low[leg] = (uint16_t)((low > 0.0f) ? low : 0.0f);
        levels.high[leg] = (uint16_t)(d->offset_counts[leg] + span + 1.0f);
    }
    levels.low[HT_ADC_VDC] = 0u;
    levels.high[HT_ADC_VDC] = (uint16_t)((vdc < (float)HT_ADC_FULL) ? vdc : (float)HT_ADC_FULL);
    ht_port_trip_levels(d->port, &levels);
}

/* The d axis turns with the shaft. */
static void turn_rotor(ht_drive *d, int32_t moved)
{
    const ht_alignment_config *c = &d->config->alignment;
    uint16_t faults = ht_protect_encoder(&d->config->protect, &d->protect, (float)moved);
    d->rotor.electrical = ht_electrical(d->rotor.electrical, moved, c->pole_pairs, c->counts_rev);
    d->in.axis = ht_unit((float)d->rotor.electrical / (float)c->counts_rev);
    d->rotor_faults = faults;
}

static void measure(ht_drive *d)
{
    const ht_samples *s = &d->samples;
    uint32_t moved = s->position - d->position_now;
    float turn = (float)(int32_t)moved * d->turn_per_count;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->in.i_A.p[leg] = ((float)s->adc[HT_ADC_I + leg] - d->offset_counts[leg]) * d->i_per_count;
    }
    d->in.vdc_V = (float)s->adc[HT_ADC_VDC] * d->v_per_count;
    d->in.turn_rad = ht_limited(turn, TURN_MAX_RAD);
    d->position_now = s->position;
    if (d->config->has_axis) {
        turn_rotor(d, (int32_t)moved);
    }
}

/* Once in each period. BUILD at standstill and RUN look with the dc link's limits. */
HT_SELDOM static void look_at_link(ht_drive *d)
{
    if (d->in.vdc_V > d->look_above_V) {
        ht_drive_follow_chopper(d);
    }
}

/* Legs whose gates are on while the drive runs, a state word. */
static uint16_t used_legs(const ht_drive *d)
{
    return (uint16_t)(HT_ALL_LEGS & ~(unsigned)d->off_legs);
}

/* A latch is set that the drive has not set. */
HT_SELDOM static uint16_t tripped_by(const ht_drive *d)
{
    unsigned faults = ht_drive_by_comparator(d);
    if (ht_port_interrupt_lost(d->port)) {
        faults |= HT_FAULT_INTERRUPT;
    }
    return (faults != 0u) ? (uint16_t)faults : (uint16_t)HT_FAULT_EXTERNAL;
}

/* The leg at which the next interrupt looks. */
static inline void next_leg(ht_drive *d)
{
    uint16_t leg = d->stuck_leg;
    d->stuck_leg = ((leg + 1u) < (uint16_t)HT_LEGS) ? (uint16_t)(leg + 1u) : 0u;
}

/* The turn is at no leg: it begins anew, with the samples handed over if they were awaited, or four interrupts
 * bring a look that the slow interrupt has asked for. Two of them know the patterns, and two of them or the next
 * ones the currents, because under shadow load a pattern takes effect a period later. */
HT_SELDOM static void bring_look(ht_drive *d, const ht_compare *out)
{
    unsigned part = (unsigned)d->heat_turn - (unsigned)HT_LEGS;
    unsigned later = d->config->control.shadow ? 2u : 1u;
    if (part == 0u) {
        d->heat.gathered.turns += 1.0f;
        if (d->heat.full == 0u) {
            ht_heat_hand_over(&d->heat);
            d->heat_turn = 0u;
            return;
        }
    }
    if ((d->looked != 0u) || (d->look_wait != 0u)) {
        if (d->looked == 0u) {
            d->look_wait--;
        }
        d->heat_turn = 0u;
        return;
    }
    if (part < 2u) {
        d->look.pattern[part] = *out;
    }
    if ((part >= later) && (part < (later + 2u))) {
        d->look.i_A[part - later] = d->in.i_A;
        d->look.axis = d->in.axis;
    }
    if (part < 3u) {
        d->heat_turn++;
    } else {
        d->looked = 1u;
        d->heat_turn = 0u;
    }
}

/* The next pattern, and a look at the squared current of one phase, in every seventh interrupt at none. A
 * switching period has one, two or four interrupts: so the looks at a phase meet each of them in turn. */
static inline void write_pattern(ht_drive *d, const ht_compare *out)
{
    uint16_t leg = d->heat_turn;
    ht_port_write(d->port, out);
    if (leg < (uint16_t)HT_LEGS) {
        float i_A = d->in.i_A.p[leg];
        d->heat.gathered.sum_A2[leg] += i_A * i_A;
        d->heat_turn = (uint16_t)(leg + 1u);
    } else {
        bring_look(d, out);
    }
}

/* Everything that is known before the control step. `powered`: the gates are on, and
 * what that needs is known. */
static inline uint16_t faults_before(ht_drive *d, bool powered)
{
    unsigned faults = ht_protect_samples(&d->config->protect, &d->in, d->speed_rpm, powered);
    if (powered) {
        uint16_t leg = d->stuck_leg;
        faults |= ht_protect_stuck(&d->config->protect, &d->protect, &d->samples, leg);
        next_leg(d);
        bool off = (d->off_legs & (HT_LEG_U1 >> leg)) != 0u;
        if (ht_port_leg_tripped(d->port, leg) != off) { /* all legs in six periods */
            faults |= tripped_by(d);
        }
    }
    return (uint16_t)faults;
}

#define MOST_TORQUE 2.0f /* ride_through */

/* Legs that are not used from now on. The gates are only ever switched off here, so that a trip
 * that comes at the same time stays one. */
HT_SELDOM static bool go_on_without(ht_drive *d, uint16_t legs)
{
    bool most = d->config->params.v[HT_P_ride_through] == MOST_TORQUE;
    uint16_t leg;
    d->off_legs = ht_control_lose(
        &d->config->control, &d->control,
        most ? ht_lost_legs_paired(d->config->control.observer.winding, legs) : legs, d->sets.ohm);
    for (leg = 0u; leg < (uint16_t)HT_LEGS; leg++) {
        if ((d->off_legs & (HT_LEG_U1 >> leg)) != 0u) {
            ht_port_leg_off(d->port, leg);
        }
    }
    d->warnings = (uint16_t)(d->warnings | legs); /* one bit for each phase */
    return d->off_legs != 0u;
}

/* A leg does not do what it is told. Goes on without it, or returns the fault. */
HT_SELDOM static unsigned phase_lost(ht_drive *d)
{
    ht_leg_loss loss = ht_leg_loss_of(d->control.leg_loss.found);
    unsigned leg = HT_LEG_U1 >> loss.leg;
    unsigned what = loss.lower ? (unsigned)HT_WARNING_NO_LOWER : (unsigned)HT_WARNING_NO_UPPER;
    if (d->off_legs != 0u) {
        d->warnings = (uint16_t)(d->warnings | (unsigned)HT_WARNING_MORE_LOST
                                 | ht_leg_loss_dead(&d->control.leg_loss));
        return HT_FAULT_PHASE;
    }
    d->warnings = (uint16_t)(leg | what);
    if ((d->state == (uint16_t)HT_STATE_RUN) && (d->config->params.v[HT_P_ride_through] != 0.0f)
        && ht_control_can_lose(&d->config->control)) {
        return go_on_without(d, (uint16_t)leg) ? 0u : HT_FAULT_PHASE;
    }
    return HT_FAULT_PHASE;
}

/* Did the interrupt take too long? Under immediate load the PWM was past edges of this period when
 * they were written, if it was later than `write_delay_us`. */
static inline bool too_late(ht_drive *d)
{
    d->end_counts = ht_port_counts(d->port);
    return ht_port_overrun(d->port)
           || (!d->config->control.shadow && (d->end_counts > d->config->control.period.first));
}

/* And everything that is known after it. */
static inline void protect_after(ht_drive *d)
{
    unsigned faults = ht_protect_results(&d->config->protect, &d->control, d->in.torque_ref_Nm);
    if (too_late(d)) {
        faults |= HT_FAULT_OVERRUN;
    }
    if (d->control.leg_loss.found != 0u) {
        faults |= phase_lost(d);
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
    }
}

/* Position of the encoder's zero. */
static uint32_t zero_of(const ht_drive *d)
{
    uint32_t zero = d->config->index.used ? d->index.reference : 0u;
    return d->config->absolute.used ? d->absolute.reference : zero;
}

float ht_drive_zero_counts(const ht_drive *d)
{
    const ht_drive_config *c = ht_config_in_force(d);
    bool known = (!c->index.used || d->index.known) && (!c->absolute.used || d->absolute.known);
    uint32_t zero = zero_of(d);
    uint32_t counts = ht_electrical(0u, (int32_t)zero, 1u, c->alignment.counts_rev);
    return known ? (float)counts : -1.0f;
}

/* Angle of the d axis as the encoder's count since its zero tells it. */
static uint32_t known_angle(const ht_drive *d)
{
    const ht_alignment_config *c = &d->config->alignment;
    float deg = d->config->params.v[HT_P_rotor_zero_deg];
    float zero = ((deg < 0.0f) ? (deg + 360.0f) : deg) / 360.0f * (float)c->counts_rev;
    uint32_t moved = d->samples.position - zero_of(d);
    return ht_electrical((uint32_t)zero % c->counts_rev, (int32_t)moved, c->pole_pairs,
                         c->counts_rev);
}

/* The gates are off: the flux goes on with the shaft. */
HT_SELDOM static void coast(ht_drive *d)
{
    const ht_observer_config *c = &d->config->control.observer;
    const ht_ab no_current = {0.0f, 0.0f};
    d->off_ticks = (d->off_ticks < 0xFFFFu) ? (uint16_t)(d->off_ticks + 1u) : 0xFFFFu;
    if (d->config->has_axis) {
        return;
    }
    d->flux_unknown *= 1.0f - c->rotor_decay;
    if (d->flux_unknown < HT_FLUX_KNOWN) {
        ht_observer_coast(c, &d->control.observer, d->in.turn_rad);
    } else {
        ht_observer_reset(c, &d->control.observer, no_current);
    }
}

/* Current in alpha-beta. */
static ht_ab current_A(const ht_drive *d)
{
    return ht_vsd_turned(d->config->control.observer.winding, ht_vsd_from_six(&d->in.i_A)).ab;
}

/* Electrical speed of the rotor, as measured. */
static float omega_rad_s(const ht_drive *d)
{
    return d->speed_rpm / d->config->protect.rpm_per_rad_s;
}

/* Faults after which the gates stay off: a switch may have failed, and the lower ones would complete its
 * short circuit. */
#define NO_SHORT_CIRCUIT ((uint32_t)HT_FAULT_OVERCURRENT | (uint32_t)HT_FAULT_EXTERNAL)

/* Magnets that need the short circuit as trip state, or may. */
HT_SELDOM static void hold(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    ht_short_circuit_input in;
    in.i_A = current_A(d);
    in.vdc_V = d->in.vdc_V;
    in.omega_rad_s = omega_rad_s(d);
    in.encoder_doubtful = (d->faults & (uint32_t)HT_FAULT_ENCODER) != 0u;
    if ((d->short_circuit.on != 0u) && ht_short_circuit_beyond(&c->short_circuit, in.i_A)) {
        ht_drive_trip(d, HT_FAULT_OVERCURRENT);
    }
    in.forbidden = ((d->faults & NO_SHORT_CIRCUIT) != 0u) || ht_port_trip_pin_low(d->port);
    if (ht_short_circuit_step(&c->short_circuit, &d->short_circuit, &in)) {
        ht_port_short_circuit(d->port);
        d->off_ticks = 0u; /* currents flow */
    } else {
        ht_port_gates_off(d->port);
    }
}

/* One period in a state without control: no latch may stay released. */
static void stay_off(ht_drive *d)
{
    if (d->config->short_circuit.allowed) {
        hold(d);
    } else {
        ht_port_gates_off(d->port);
    }
    coast(d);
}

/* Less than this share of the flux reference is no flux to take over. */
#define LEFT_OVER 0.05f

/* A rotor whose angle is known, at a speed at which it makes a current to judge it by, and no more voltage
 * than the link has. */
static bool can_catch_rotor(const ht_drive *d)
{
    const ht_drive_config *c = d->config;
    float omega = fabsf(omega_rad_s(d));
    float most = HT_CLEAR_OF_CEILING
                 * ht_short_circuit_ceiling_rad_s(&c->short_circuit, d->in.vdc_V);
    return (c->alignment.known || (d->flux_unknown < HT_FLUX_KNOWN)) && (omega < most)
           && (omega
               > ht_rotor_catch_least_rad_s(&c->control.observer, c->params.v[HT_P_i_trip_A]));
}

bool ht_drive_can_catch(const ht_drive *d)
{
    const float *v = d->params.v;
    bool known = d->config->has_axis ? can_catch_rotor(d) : (d->flux_unknown < HT_FLUX_KNOWN);
    return known && (v[HT_P_lost_legs] == 0.0f) && (v[HT_P_start_mode] == 0.0f);
}

/* The same where the rotor has a d axis: a standing one is aligned. */
HT_SELDOM static void begin_rotor(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    const float *v = c->params.v;
    float counts = d->speed_rpm * v[HT_P_encoder_counts_rev] / (60.0f * v[HT_P_f_isr_Hz]);
    bool turns = !ht_finite_below(d->speed_rpm, v[HT_P_start_max_rpm]);
    d->catches = 0u;
    ht_control_reset(&c->control, &d->control, &d->in.i_A);
    if (turns && ht_drive_can_catch(d)) {
        d->catches = 1u;
        d->protect.counts_quick = counts; /* the shaft has not just begun to turn */
        d->protect.counts_slow = counts;
        ht_rotor_catch_begin(&d->rotor_catch);
    }
    if ((d->catches == 0u) || c->alignment.known) {
        d->rotor.electrical = known_angle(d);
    }
}

/* Begin the build-up: from nothing at standstill, or with what the machine has. */
static void begin_flux(ht_drive *d)
{
    const float *v = d->config->params.v;
    ht_ab psi = d->control.observer.psi_Wb;
    float psi2 = psi.alpha * psi.alpha + psi.beta * psi.beta;
    float least_Wb = LEFT_OVER * v[HT_P_flux_ref_Wb];
    bool moves;
    if (d->config->has_axis) {
        begin_rotor(d);
        return;
    }
    moves = (psi2 > least_Wb * least_Wb) || !ht_finite_below(d->speed_rpm, v[HT_P_start_max_rpm]);
    d->catches = 0u;
    if (moves && ht_drive_can_catch(d)) {
        d->catches = 1u;
        d->flux_ref_Wb = sqrtf(psi2);
        ht_control_catch_begin(&d->config->control, &d->control, &d->in.i_A);
    } else {
        ht_control_reset(&d->config->control, &d->control, &d->in.i_A);
        if (d->config->heat.rs_tells != (uint16_t)HT_RS_TELLS_NOTHING) {
            ht_observer_begin_with(&d->config->control.observer, &d->control.observer,
                                   ht_heat_rs_ohm(&d->config->heat, &d->heat));
        }
    }
}

/* Diodes end the currents within this time after the gates went off: they work against the dc link. */
#define CURRENTS_END_S 0.005f

/* Slow interrupts until an absolute encoder that works is known, right after a reset. */
#define ABSOLUTE_WAITS 4.0f

static void calibrate(ht_drive *d)
{
    /* The other ones are of the run before: the slow loop may not have come by since. */
    uint32_t faults = faults_before(d, false) | (d->slow_faults & HT_LASTING_FAULTS);
    int leg;
    if (ht_port_trip_pin_low(d->port)) { /* before the gates ever come on */
        faults |= HT_FAULT_EXTERNAL;
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return;
    }
    if (d->state_ticks == 1u) { /* all legs low before the gates ever come on */
        ht_compare low;
        ht_control_low_pattern(&d->config->control, &low);
        ht_port_write(d->port, &low);
        d->heat_turn = 0u; /* a look that the gates' end has broken off */
    }
    coast(d);
    if ((float)d->off_ticks < CURRENTS_END_S * d->config->params.v[HT_P_f_isr_Hz]) {
        d->state_ticks = 0u; /* begin anew */
        return;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        d->offset_sum[leg] += d->samples.adc[HT_ADC_I + leg];
    }
    if (d->state_ticks < d->calibration_ticks) {
        return;
    }
    if (d->config->absolute.used && !d->absolute.known) {
        const float *v = d->config->params.v;
        if ((float)d->state_ticks * v[HT_P_f_slow_Hz] > ABSOLUTE_WAITS * v[HT_P_f_isr_Hz]) {
            ht_drive_trip(d, HT_FAULT_ABSOLUTE);
        }
        return;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        float mean = (float)d->offset_sum[leg] / (float)d->state_ticks;
        if (!ht_finite_below(mean - (float)HT_ADC_MID, (float)HT_OFFSET_MOST_COUNTS)) {
            ht_drive_trip(d, HT_FAULT_CALIBRATION);
            return;
        }
        d->offset_counts[leg] = mean;
    }
    ht_drive_set_levels(d);
    measure(d);
    ht_protect_reset(&d->protect);
    d->slow_faults = 0u; /* of the run before: the slow loop may not have come by since */
    begin_flux(d);
    ht_speed_reset(&d->speed);
    ht_ramp_reset(&d->ramp, d->speed_rpm);
    d->motion = (uint16_t)HT_MOTION_FOLLOW;
    d->off_ticks = 0u;
    ht_short_circuit_ends(&d->short_circuit);
    ht_set_difference_begin(&d->sets);
    d->torque_ref_Nm = 0.0f;
    d->vdc_acts = 0u;
    d->vdc_from_rpm = 0.0f;
    d->limits = 0u;
    (void)go_on_without(d, (uint16_t)d->config->params.v[HT_P_lost_legs]);
    if (d->config->params.v[HT_P_start_mode] != 0.0f) {
        ht_excitation_reset(&d->excitation, d->samples.position);
        d->flux_unknown = 1.0f; /* a test may leave one */
        ht_drive_enter(d, HT_STATE_TEST);
    } else {
        ht_drive_enter(d, HT_STATE_BUILD);
    }
    protect_after(d);
}

/* Flux reference of the build-up; returns how far it has come. */
static float begin_build(ht_drive *d)
{
    uint32_t ticks = d->build_ticks + 1u;
    float share = (float)d->state_ticks / (float)ticks; /* 1 at most */
    ht_drive_set_flux_ref(d, d->config->params.v[HT_P_flux_ref_Wb] * share);
    return share;
}

/* In the second period of a state a pattern is in place, and the gates go on. */
static bool gates_refused(ht_drive *d)
{
    return (d->state_ticks == 1u) && !ht_port_gates_on(d->port, used_legs(d));
}

/* The flux is there: torque control begins. */
static void begin_run(ht_drive *d, float omega)
{
    d->flux_ramp_Wb = d->flux_ref_Wb;
    d->omega_mean_rad_s = omega;
    d->flux_lowered = 0u;
    d->flux_unknown = 0.0f;
    ht_least_loss_reset(&d->least_loss, d->flux_ref_Wb);
    ht_flux_brake_reset(&d->flux_brake);
    ht_drive_enter(d, HT_STATE_RUN);
}

static void end_build(ht_drive *d, float share)
{
    if (share < HT_BUILD_BLIND) {
        ht_observer_stand_still(&d->control.observer);
    }
    if (gates_refused(d)) {
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
    } else if (d->state_ticks >= d->build_ticks) {
        ht_drive_set_flux_ref(d, d->config->params.v[HT_P_flux_ref_Wb]);
        begin_run(d, 0.0f);
    } else {
        /* still building */
    }
}

/* The dc link is beyond one of the voltages where its limits begin, or its chopper may come on or off. */
HT_SELDOM static void limit_by_vdc(ht_drive *d)
{
    const ht_vdc_config *c = &d->config->vdc;
    float vdc_V = d->in.vdc_V;
    float torque_Nm;
    ht_drive_follow_chopper(d);
    if ((d->state != (uint16_t)HT_STATE_RUN) || ((vdc_V <= c->above_V) && (vdc_V >= c->below_V))) {
        return;
    }
    torque_Nm = ht_vdc_torque_Nm(c, d->torque_ref_Nm, d->torque_limit_Nm,
                                 d->speed_rpm * HT_RAD_S_PER_RPM,
                                 d->vdc_from_rpm * HT_RAD_S_PER_RPM, vdc_V);
    torque_Nm = (torque_Nm < d->torque_least_Nm) ? d->torque_least_Nm : torque_Nm;
    if (torque_Nm != d->torque_ref_Nm) {
        unsigned acts = (vdc_V > c->above_V) ? (unsigned)HT_LIMIT_VDC_HIGH
                                             : (unsigned)HT_LIMIT_VDC_LOW;
        d->in.torque_ref_Nm = torque_Nm;
        d->vdc_acts = (uint16_t)(d->vdc_acts | acts);
    }
}

/* One period of BUILD or RUN. */
static inline void drive(ht_drive *d, bool build)
{
    ht_compare out;
    float share = 1.0f;
    /* The latch was released in the first interrupt of BUILD. */
    bool powered = !build || (d->state_ticks > 1u);
    uint32_t faults = faults_before(d, powered);
    if (build && powered
        && ht_port_tripped(d->port, used_legs(d))) { /* just released: all at once */
        faults |= tripped_by(d);
    }
    faults |= d->slow_faults;
    if (d->config->has_axis) {
        faults |= d->rotor_faults;
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return;
    }
    d->in.torque_ref_Nm = d->torque_ref_Nm; /* 0 in BUILD */
    if ((d->in.vdc_V > d->look_above_V) || (!build && (d->in.vdc_V < d->config->vdc.below_V))) {
        limit_by_vdc(d);
    }
    if (build) {
        share = begin_build(d);
    } else if (d->in.flux_ref_Wb != d->flux_ref_Wb) {
        ht_drive_set_flux_ref(d, d->flux_ref_Wb);
    } else {
        /* as it was */
    }
    ht_control_step(&d->config->control, &d->control, &d->in, build, &out);
    write_pattern(d, &out);
    if (build) {
        end_build(d, share);
    }
    protect_after(d);
}

/* Without some of the legs the current in x-y turns the rotor aside, as far as its harmonics are told. */
HT_SELDOM static void turn_aside(ht_drive *d)
{
    const ht_alignment_config *c = &d->config->alignment;
    const ht_observer_config *m = &d->config->control.observer;
    ht_vsd i;
    float counts = TURNS_PER_RAD * (float)c->counts_rev;
    i.ab = d->control.observer.i_A;
    i.xy = d->control.i_xy_A;
    counts *=
        HT_ROTOR_DOES(m->rotor, aside_rad, (m, ht_twelfth(m->winding, d->rotor.direction), i));
    d->rotor.electrical = ht_electrical(d->rotor.electrical, (int32_t)counts, 1u, c->counts_rev);
}

/* The rotor stands where its angle is known, and the drive goes on from there. */
HT_SELDOM static void begin_run_aligned(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    if ((d->control.lost.axes != 0u) && !c->alignment.known) {
        turn_aside(d);
    }
    d->in.axis = ht_unit((float)d->rotor.electrical / (float)c->alignment.counts_rev);
    HT_ROTOR_DOES(
        c->control.observer.rotor, align,
        (&c->control.observer, &d->control.observer, d->control.observer.i_A, d->in.axis));
    d->control.estimate.psi_Wb = d->control.observer.psi_Wb;
    ht_drive_set_flux_ref(d,
                          HT_ROTOR_DOES(c->control.observer.rotor, own_Wb, (&c->control.observer)));
    d->omega_mean_rad_s = 0.0f;
    ht_least_loss_reset(&d->least_loss, d->flux_ref_Wb);
    d->flux_unknown = 0.0f;
    ht_drive_enter(d, HT_STATE_RUN);
}

/* Faults known before a period of BUILD that needs no standstill: the speed tells nothing. */
static unsigned faults_in_build(ht_drive *d)
{
    bool powered = d->state_ticks > 1u;
    unsigned faults = faults_before(d, powered);
    if (powered && ht_port_tripped(d->port, used_legs(d))) {
        faults |= tripped_by(d);
    }
    return faults;
}

/* One period of BUILD that aligns. */
HT_SELDOM static void align(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    uint32_t faults = faults_in_build(d) | d->slow_faults; /* the shaft may swing */
    ht_alignment step;
    ht_compare out;
    look_at_link(d);
    if (d->state_ticks == 1u) {
        ht_alignment_begin(&c->alignment, &d->rotor, ht_lost_legs_aligning(&d->control.lost));
    }
    step = ht_alignment_step(&c->alignment, &d->rotor, d->state_ticks);
    if (step == HT_NOT_ALIGNED) {
        faults |= HT_FAULT_ENCODER;
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return;
    }
    d->in.omega_rad_s = omega_rad_s(d);
    ht_control_align(&c->control, &d->control, &d->in, d->rotor.direction, &out);
    write_pattern(d, &out);
    if (gates_refused(d)) {
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
    } else if (step == HT_ALIGNED) {
        begin_run_aligned(d);
    } else {
        /* still aligning */
    }
    protect_after(d);
}

/* The turning rotor is where it is believed to be. Control begins in this period (first_step), without torque:
 * with the rotor's own flux, or what the voltage turns of it. */
HT_SELDOM static void begin_run_caught(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    float omega = omega_rad_s(d);
    float flux_Wb = HT_ROTOR_DOES(c->control.observer.rotor, own_Wb, (&c->control.observer));
    float most_V = c->flux.reach_pu * d->in.vdc_V;
    ht_control_reset(&c->control, &d->control, &d->in.i_A);
    HT_ROTOR_DOES(
        c->control.observer.rotor, align,
        (&c->control.observer, &d->control.observer, d->control.observer.i_A, d->in.axis));
    d->control.observer.omega_sync_rad_s = omega;
    if ((fabsf(omega) * flux_Wb) > most_V) {
        flux_Wb = most_V / fabsf(omega);
    }
    ht_drive_set_flux_ref(d, flux_Wb);
    d->in.torque_ref_Nm = 0.0f;
    begin_run(d, omega);
}

/* The control step of a rotor that has just been caught. In the interrupt's own function, so that it takes no
 * more stack than a period of RUN. */
static HT_INTO_CALLERS void first_step(ht_drive *d)
{
    ht_compare out;
    ht_control_step(&d->config->control, &d->control, &d->in, false, &out);
    write_pattern(d, &out);
    protect_after(d);
}

/* One period of BUILD that catches a turning rotor with a d axis. Returns whether it is caught. */
HT_SELDOM static bool catch_rotor(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    uint32_t faults = faults_in_build(d) | d->slow_faults | d->rotor_faults;
    ht_rotor_catch found = HT_CATCHING;
    ht_compare low;
    look_at_link(d);
    if (d->state_ticks > 1u) {
        found = ht_rotor_catch_step(&c->control.observer, &d->rotor_catch, omega_rad_s(d),
                                    d->in.axis, current_A(d), c->protect.i_trip_A);
    }
    if (found == HT_NOT_CAUGHT) {
        faults |= HT_FAULT_ENCODER;
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return false;
    }
    if (found == HT_CAUGHT) {
        return true;
    }
    ht_control_low_pattern(&c->control, &low); /* the pattern stays: all legs low */
    write_pattern(d, &low);
    if (gates_refused(d)) {
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
    }
    protect_after(d);
    return false;
}

/* Share of the dc link's voltage that the flux of a shaft that is caught may take at most: the rest is left
 * for the current. In RUN the flux then rises to what weakening lets it have. */
#define CATCH_PU 0.5f

/* The next flux reference of a shaft that is caught. It rises as fast as at standstill, but waits while the
 * current is at its limit. */
static float caught_Wb(const ht_drive *d, float omega)
{
    const ht_control_config *c = &d->config->control;
    ht_ab i = d->control.observer.i_A;
    float most_Wb = d->config->params.v[HT_P_flux_ref_Wb];
    uint32_t steps = d->build_ticks + 1u;
    float step_Wb = most_Wb / (float)steps;
    float turned_V = fabsf(omega) * most_Wb;
    float flux_Wb = d->flux_ref_Wb;
    float reach_pu = d->config->flux.reach_pu; /* the scheme must hold it */
    float most_V = ((reach_pu < CATCH_PU) ? reach_pu : CATCH_PU) * d->in.vdc_V;
    bool free = (i.alpha * i.alpha + i.beta * i.beta) < c->build_current_A * c->build_current_A;
    if (turned_V > most_V) {
        most_Wb *= most_V / turned_V;
    }
    if ((flux_Wb < most_Wb) && !free) {
        return flux_Wb;
    }
    return flux_Wb + ht_limited(most_Wb - flux_Wb, step_Wb);
}

/* One period of BUILD that catches a turning shaft. */
HT_SELDOM static void catch_shaft(ht_drive *d)
{
    const ht_drive_config *c = d->config;
    uint32_t faults = faults_in_build(d) | d->slow_faults;
    float omega = omega_rad_s(d);
    ht_compare out;
    look_at_link(d);
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return;
    }
    d->in.omega_rad_s = omega;
    ht_drive_set_flux_ref(d, caught_Wb(d, omega));
    ht_control_catch(&c->control, &d->control, &d->in, &out);
    write_pattern(d, &out);
    if (gates_refused(d)) {
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
    } else if (d->state_ticks >= d->build_ticks) {
        begin_run(d, omega);
    } else {
        /* still building */
    }
    protect_after(d);
}

/* One period of TEST. The sums of the currents and their sensors are not checked: wrong sensors
 * are what a test looks for. */
static void test(ht_drive *d)
{
    const ht_control_config *c = &d->config->control;
    ht_compare out;
    uint32_t faults = d->slow_faults
                      | ht_protect_samples(&d->config->protect, &d->in, d->speed_rpm, false);
    faults |= ht_excitation_faults(&d->config->excitation, &d->excitation, &d->in.i_A,
                                   d->samples.position);
    if ((d->state_ticks > 1u) && ht_port_tripped(d->port, used_legs(d))) {
        faults |= tripped_by(d);
    }
    if (faults != 0u) {
        ht_drive_trip(d, faults);
        return;
    }
    if (d->state_ticks >= d->config->excitation.ticks) {
        ht_port_gates_off(d->port);
        ht_drive_enter(d, HT_STATE_IDLE);
        return;
    }
    ht_excitation_step(&d->config->excitation, &d->excitation, d->in.vdc_V, &c->period, &out);
    write_pattern(d, &out);
    if (gates_refused(d)) {
        ht_drive_trip(d, HT_FAULT_EXTERNAL);
    } else if (too_late(d)) {
        ht_drive_trip(d, HT_FAULT_OVERRUN);
    } else {
        /* goes on */
    }
}

/* Parameters that have changed take effect. */
HT_SELDOM static void take_staged(ht_drive *d)
{
    const float *before = d->config->params.v;
    const float *now = d->staged->params.v;
    bool moved = (now[HT_P_i_trip_A] != before[HT_P_i_trip_A])
                 || (now[HT_P_vdc_max_V] != before[HT_P_vdc_max_V])
                 || (now[HT_P_comparator_above_pu] != before[HT_P_comparator_above_pu]);
    ht_control_switch_over(&d->config->control, &d->staged->control, &d->control);
    d->config = d->staged;
    d->taken_tick = d->tick;
    d->staged = NULL;
    ht_drive_look(d);
    if (moved) {
        ht_drive_set_levels(d);
    }
    if (d->state == (uint16_t)HT_STATE_TEST) {
        ht_excitation_begin(&d->excitation);
    }
    if ((d->off_legs != 0u) && !ht_control_can_lose(&d->config->control)) {
        /* It cannot do without a leg any more. This interrupt acts on it. */
        d->slow_faults |= HT_FAULT_PHASE;
    }
}

void ht_drive_fast_isr(ht_drive *d)
{
    ht_state state = (ht_state)d->state;
    ht_port_begin_fast(d->port);
    ht_port_read(d->port, &d->samples);
    d->tick++;
    if (d->staged != NULL) {
        take_staged(d);
    }
    measure(d);
    switch (state) {
    case HT_STATE_RUN:
        d->state_ticks++;
        drive(d, false);
        break;
    case HT_STATE_BUILD:
        d->state_ticks++;
        if (d->config->has_axis && (d->catches != 0u)) {
            if (catch_rotor(d)) {
                begin_run_caught(d);
                first_step(d);
            }
        } else if (d->config->has_axis) {
            align(d);
        } else if (d->catches != 0u) {
            catch_shaft(d);
        } else {
            drive(d, true);
        }
        break;
    case HT_STATE_CALIBRATE:
        d->state_ticks++;
        look_at_link(d);
        calibrate(d);
        break;
    case HT_STATE_TEST:
        d->state_ticks++;
        look_at_link(d);
        test(d);
        break;
    case HT_STATE_IDLE: /* no tick: a start that this interrupt comes into would lose it */
    case HT_STATE_FAULT:
    default:
        look_at_link(d);
        stay_off(d);
        break;
    }
    ht_port_ack_fast(d->port);
}
