/* The whole pattern of the law that interleaves carriers: one decision from any state that earlier ones
 * can have left, and by what that shows the four of a carrier's period. One leg's counts by what
 * prove_edge_counts shows. */
#include "ht_contracts.h"
#include "ht_interleaved.c"
#include "ht_interleaved_law.c"
#include "law_input.h"
#include "xy_regulator_contract.h"

/* The leg that is watched, any, and its set. */
static unsigned leg_watched;
static unsigned set_watched;
static unsigned bit_watched;

/* The period that is being proved. */
static ht_period the_period;

/* What one decision makes of the leg. */
typedef struct {
    bool begins; /* a half of its set */
    bool up;     /* then: the way of the half */
    bool brief;  /* and it lasts this period only */
    bool turns;  /* set 2's carrier turns, or the sets come together or apart */
    bool bare;   /* the very first decision */
    bool high;   /* at the period's start */
    uint32_t ca;
} a_step;

static a_step does;

/* What earlier decisions have made of it. */
typedef struct {
    bool up;         /* the way of the latest half */
    bool fresh;      /* which began in the latest period and goes on */
    bool steady;     /* nothing has turned since that one began */
    bool high;       /* at the end of the latest period */
    uint32_t lasted; /* counts from its latest edge to there, at least */
} a_past;

/* --- What is called ---------------------------------------------------------------- */

ht_vsd ht_vsd_from_six(const ht_six *s)
{
    ht_vsd v;
    v.ab = any_ab();
    v.xy = any_xy();
    (void)s;
    return v;
}

ht_sets ht_modulator_alternating(float kappa, float kappa_from_pu, ht_ab v_pu)
{
    ht_sets sets;
    sets.kappa[0] = nondet_float();
    sets.kappa[1] = nondet_float();
    sets.opposite = nondet_bool();
    return sets;
}

ht_dq ht_magnet_wanted_Wb(const ht_magnet_config *m, float size_Wb, ht_dq now, float length_Wb,
                          float torque_Nm)
{
    ht_dq wanted;
    wanted.d = nondet_float();
    wanted.q = nondet_float();
    return wanted;
}

void ht_modulator_centre(ht_modulator_config *cfg, bool turned)
{
    (void)cfg;
    (void)turned;
}

void ht_deadbeat_law_reset(ht_deadbeat_law_state *st)
{
    ht_xy_reset(&st->xy);
}

/* A half of one period. */
static bool is_brief(const half_of *h)
{
    return h->full == (float)(the_period.counts - 1u);
}

static float any_full(void)
{
    return nondet_bool() ? (float)(the_period.counts - 1u) : (2.0f * (float)the_period.counts);
}

/* What prove_edge_counts shows of a leg, for the numbers that it relies on. */
static uint32_t promise_edge_counts(const half_of *h, float share, float at)
{
    uint32_t count = nondet_uint32();
    uint32_t end = the_period.counts;
    uint32_t in_period = (count < end) ? count : (count - end);
    MUST((h->end == end) && (h->shortest == the_period.shortest));
    MUST(is_brief(h) || (h->full == 2.0f * (float)the_period.counts));
    GIVEN((count == 0u) || (count == 2u * end)
          || ((in_period < end) && HT_IS_COMPARE(in_period, the_period)
              && IMPLIES(is_brief(h), count < end)));
    return count;
}

/* What prove_interleaved_command shows. */
static ht_interleaved_command promise_command_of(const ht_interleaved_law_config *cfg,
                                                 const ht_observer_config *machine,
                                                 ht_interleaved_law_state *st,
                                                 const ht_voltage_law_input *in, unsigned a)
{
    ht_interleaved_command command;
    MUST((a < 2u) && HT_IS_XY_STATE(st->deadbeat.xy, HT_LAW_XY_LIMIT_PU));
    st->deadbeat.xy.with = any_xy();
    st->deadbeat.xy.against = any_xy();
    GIVEN(HT_IS_XY_STATE(st->deadbeat.xy, HT_LAW_XY_LIMIT_PU));
    command.v_pu = any_ab();
    command.quad = any_ab();
    command.steady_pu = any_ab();
    return command;
}

/* Any numbers. */
static void promise_shares_of(unsigned a, float sense, ht_ab v, float kappa, float share[3])
{
    share[0] = nondet_float();
    share[1] = nondet_float();
    share[2] = nondet_float();
}

static float promise_slope(const ht_interleaved_config *cfg, const ht_interleaved_state *st,
                           unsigned a, unsigned k, ht_ab quad)
{
    MUST((a < 2u) && (k < 3u));
    return nondet_float();
}

/* What prove_interleaved_leg shows: a leg toggles now, or later, or is there already, or stays. */
static float promise_begin_leg(half_of *h, ht_interleaved_set *set, unsigned k, unsigned leg,
                               const float shares[3], const float better[3], const float i_A[],
                               making *m, ht_compare *out, ht_toggles *toggles)
{
    unsigned bit = HT_LEG_U1 >> leg;
    uint16_t count = nondet_uint16();
    MUST((k < 3u) && (leg < 6u) && (m->end == the_period.counts));
    MUST((h->end == the_period.counts) && (h->shortest == the_period.shortest));
    GIVEN((count < the_period.counts) && HT_IS_COMPARE(count, the_period));
    out->ca[leg] = m->end;
    if (nondet_bool()) {
        h->after |= bit;
    } else if (nondet_bool()) {
        h->now |= bit;
        out->ca[leg] = count;
    } else if (!is_brief(h) && nondet_bool()) {
        h->later |= bit;
        set->next[k] = count;
    } else {
        /* stays */
    }
    return nondet_float();
}

/* A half begins, and the one before is over. */
static ht_ab promise_begin(const ht_interleaved_config *cfg, ht_interleaved_state *st, unsigned a,
                           const ht_interleaved_command *command, const ht_modulator_input *in,
                           making *m, ht_compare *out, ht_toggles *toggles)
{
    MUST((a < 2u) && (st->set[a].moves == 0u));
    if (a == set_watched) {
        does.begins = true;
        does.brief = (a == 1u) && st->brief;
        does.up = (st->quarter < 2u) != ((a == 1u) && st->opposite);
    }
    return begin(cfg, st, a, command, in, m, out, toggles);
}

/* --- The state between two decisions ----------------------------------------------- */

/* A leg that toggles in a half's second period does so in the range of a register. */
static bool is_half(const ht_interleaved_set *set, unsigned a)
{
    bool good = (set->moves & ~legs_of[a]) == 0u;
    unsigned k;
    for (k = 0u; k < 3u; k++) {
        if ((set->moves & (HT_LEG_U1 >> leg_of[a][k])) != 0u) {
            good = good && (set->next[k] < the_period.counts)
                   && HT_IS_COMPARE(set->next[k], the_period);
        }
    }
    return good;
}

/* And a half that must begin finds the one before over. */
static bool is_state(const ht_interleaved_law_state *st)
{
    const ht_interleaved_state *p = &st->positions;
    bool even = (p->quarter & 1u) == 0u;
    return HT_IS_XY_STATE(st->deadbeat.xy, HT_LAW_XY_LIMIT_PU) && (p->quarter < 4u)
           && (p->turn < 3u) && (p->carrier < HT_TURN_CARRIERS) && is_half(&p->set[0], 0u)
           && is_half(&p->set[1], 1u) && IMPLIES(even, p->set[0].moves == 0u)
           && IMPLIES(even == p->joined, p->set[1].moves == 0u)
           && IMPLIES(even || p->joined, p->joined == p->together)
           && IMPLIES(p->brief, p->joined == even)
           && IMPLIES(!p->together, !p->opposite || p->brief)
           && IMPLIES(!st->begun,
                      (p->quarter == 0u) && !p->joined && !p->brief && (p->set[1].moves == 0u));
}

/* What a leg has done and what is still to be done fit each other. */
static bool is_past(const ht_interleaved_law_state *st, const a_past *past)
{
    const ht_interleaved_state *p = &st->positions;
    bool even = (p->quarter & 1u) == 0u;
    bool waits = (p->set[set_watched].moves & bit_watched) != 0u;
    bool due = (set_watched == 0u) ? even : (even == p->joined);
    bool first = (p->quarter == 2u)
                 || (p->quarter == (((set_watched == 0u) || p->joined || p->brief) ? 1u : 3u));
    bool up = first != ((set_watched == 1u) && p->opposite);
    return IMPLIES(waits, past->fresh && (past->high != past->up)) && IMPLIES(past->fresh, !due)
           && IMPLIES((set_watched == 0u) || past->steady, past->up == up)
           && (past->lasted >= the_period.shortest) && (past->lasted <= the_period.counts);
}

/* --- What a decision may do -------------------------------------------------------- */

static bool toggles_in(const a_step *step)
{
    return step->ca != the_period.counts;
}

static void pass(a_past *past, const a_step *step)
{
    bool moves = toggles_in(step);
    past->up = step->begins ? step->up : past->up;
    past->fresh = step->begins && !step->brief;
    past->steady = step->begins || (past->steady && !step->turns);
    past->high = step->high != moves;
    past->lasted = moves ? (the_period.counts - step->ca) : the_period.counts;
}

/* An edge at a period's very start begins a half, or clears the legs of set 2 before its first one. A
 * register toggles a leg the way of the half, so once in it. Every edge is the shortest pulse behind the one before.
 * Halves go either way by turns, those of set 2 unless its carrier turns. */
static bool may(const a_past *past, const a_step *step)
{
    bool starts = step->high != past->high;
    bool moves = toggles_in(step);
    bool up = step->begins ? step->up : past->up;
    uint32_t behind = (starts ? 0u : past->lasted) + step->ca;
    bool by_turns = (set_watched == 0u) || (past->steady && !step->turns);
    return IMPLIES(starts, step->begins || (step->bare && (set_watched == 1u)))
           && IMPLIES(starts, past->lasted >= the_period.shortest)
           && IMPLIES(moves, step->high != up) && IMPLIES(moves, behind >= the_period.shortest)
           && IMPLIES(moves, (step->ca + the_period.shortest) <= the_period.counts)
           && IMPLIES(step->begins, !past->fresh)
           && IMPLIES(step->begins && by_turns, step->up != past->up);
}

static void any_set(ht_interleaved_set *set)
{
    unsigned k;
    for (k = 0u; k < 3u; k++) {
        set->half_d[k] = nondet_float();
        set->delta[k] = nondet_float();
        set->next[k] = nondet_uint16();
    }
    set->moves = nondet_uint16();
}

static void any_state(ht_interleaved_law_state *st)
{
    st->deadbeat.xy.with = any_xy();
    st->deadbeat.xy.against = any_xy();
    any_set(&st->positions.set[0]);
    any_set(&st->positions.set[1]);
    st->positions.steady_pu = any_ab();
    st->positions.carrier = nondet_uint16();
    st->positions.together = nondet_bool();
    st->positions.joined = nondet_bool();
    st->positions.brief = nondet_bool();
    st->positions.opposite = nondet_bool();
    st->positions.quarter = nondet_uint16();
    st->positions.turn = nondet_uint16();
    st->off_pu[0] = any_ab();
    st->off_pu[1] = any_ab();
    st->v_pu[0] = any_ab();
    st->v_pu[1] = any_ab();
    st->begun = nondet_bool();
    GIVEN(is_state(st));
}

static a_past any_past(void)
{
    a_past past;
    past.up = nondet_bool();
    past.fresh = nondet_bool();
    past.steady = nondet_bool();
    past.high = nondet_bool();
    past.lasted = nondet_uint32();
    return past;
}

static void any_config(ht_interleaved_law_config *cfg)
{
    cfg->deadbeat.gain = nondet_float();
    cfg->deadbeat.xy_ki_per_A = nondet_float();
    cfg->deadbeat.xy_free_A2 = nondet_float();
    cfg->deadbeat.reach_pu = nondet_float();
    cfg->positions.alike = nondet_float();
    cfg->positions.cap = nondet_float();
    cfg->positions.together = nondet_uint16();
    cfg->positions.kappa = nondet_float();
    cfg->positions.kappa_from_pu = nondet_float();
}

static void any_period(void)
{
    the_period.counts = nondet_uint16();
    the_period.first = 0u;
    the_period.shortest = nondet_uint16();
    GIVEN(HT_IS_PERIOD(the_period));
    leg_watched = nondet_uint16();
    GIVEN(leg_watched < 6u);
    set_watched = ((leg_watched & 1u) == 0u) ? 0u : 1u;
    bit_watched = HT_LEG_U1 >> leg_watched;
}

/* --- The proofs -------------------------------------------------------------------- */

void prove_interleaved_reset(void)
{
    ht_interleaved_law_state st;
    a_past past = any_past();
    any_period();
    GIVEN((past.lasted >= the_period.shortest) && (past.lasted <= the_period.counts));
    past.up = false;
    past.fresh = false;
    past.steady = false;
    ht_interleaved_law_reset(&st);
    st.deadbeat.xy.with.x = 0.0f; /* what ht_xy_reset does */
    st.deadbeat.xy.with.y = 0.0f;
    st.deadbeat.xy.against = st.deadbeat.xy.with;
    MUST(is_state(&st) && is_past(&st, &past));
}

void prove_interleaved_command(void)
{
    ht_interleaved_law_config cfg;
    ht_observer_config machine = any_law_machine();
    ht_interleaved_law_state st;
    ht_voltage_law_input in = any_law_input();
    unsigned a = nondet_uint16();
    any_period();
    any_config(&cfg);
    any_state(&st);
    GIVEN(ht_interleaved_law_check(&cfg) && (a < 2u));
    (void)command_of(&cfg, &machine, &st, &in, a);
    MUST(HT_IS_XY_STATE(st.deadbeat.xy, HT_LAW_XY_LIMIT_PU));
}

/* A leg that begins its half. */
void prove_interleaved_leg(void)
{
    ht_interleaved_law_state st;
    ht_interleaved_set *set = &st.positions.set[0];
    half_of h;
    making m;
    ht_compare out;
    ht_toggles toggles;
    ht_six any[3];
    unsigned k = nondet_uint16();
    unsigned after;
    unsigned now;
    unsigned later;
    uint16_t ca;
    any_period();
    any_state(&st);
    any[0] = any_six();
    any[1] = any_six();
    any[2] = any_six();
    GIVEN(k < 3u);
    h.doubt = nondet_float();
    h.act = nondet_float();
    h.centre = nondet_float();
    h.room = nondet_float();
    h.end = the_period.counts;
    h.shortest = the_period.shortest;
    h.full = any_full();
    h.per_half = nondet_float();
    h.sense = nondet_float();
    h.at_0 = nondet_float();
    h.dead_half = nondet_float();
    h.dead_quarter = nondet_float();
    h.dead_per_A = nondet_float();
    after = nondet_uint16() & ~bit_watched;
    now = nondet_uint16() & ~bit_watched;
    later = nondet_uint16() & ~bit_watched;
    h.after = after;
    h.now = now;
    h.later = later;
    m.end = the_period.counts;
    m.per_count = nondet_float();
    (void)begin_leg(&h, set, k, leg_watched, any[0].p, any[1].p, any[2].p, &m, &out, &toggles);
    ca = out.ca[leg_watched];
    after ^= h.after;
    now ^= h.now;
    later ^= h.later;
    MUST(((after | now | later) == 0u) || ((after ^ now ^ later) == bit_watched));
    MUST(((after & now) | (now & later) | (after & later)) == 0u);
    MUST((now != 0u) ? ((ca < the_period.counts) && HT_IS_COMPARE(ca, the_period))
                     : (ca == the_period.counts));
    MUST((now != 0u) || (toggles.t[leg_watched] == 1.0f));
    MUST(!is_brief(&h) || (later == 0u));
    MUST((later == 0u)
         || ((set->next[k] < the_period.counts) && HT_IS_COMPARE(set->next[k], the_period)));
}

/* One decision. What is read of the configuration are floats, any here. */
typedef struct {
    ht_interleaved_law_state st;
    ht_compare out;
    ht_applied applied;
    ht_toggles toggles;
    uint16_t before;
} a_decision;

static void begin_decision(a_decision *d)
{
    any_period();
    any_state(&d->st);
    d->before = nondet_uint16();
    GIVEN(HT_IS_WORD(d->before));
    does.begins = false;
    does.brief = false;
    does.up = false;
    does.bare = !d->st.begun;
}

static void decide(a_decision *d)
{
    ht_interleaved_law_config cfg;
    ht_observer_config machine = any_law_machine();
    ht_voltage_law_input in = any_law_input();
    ht_modulator_input pwm;
    ht_dead_time dead;
    ht_six i_A = any_six();
    any_config(&cfg);
    dead.dead_pu = nondet_float();
    dead.i_zero_A = nondet_float();
    pwm.dead = &dead;
    pwm.i_A = &i_A;
    pwm.period = &the_period;
    pwm.before = d->before;
    (void)ht_interleaved_law_pattern(&cfg, &machine, &d->st, &in, &pwm, &d->out, &d->applied,
                                     &d->toggles);
    d->applied.own = 0u; /* the caller sets it */
}

/* What prove_control_interleaved takes for granted, and that the next decision finds a good state. */
void prove_interleaved_period(void)
{
    a_decision d;
    const ht_applied *applied = &d.applied;
    bool moves;
    begin_decision(&d);
    decide(&d);
    MUST(is_state(&d.st) && d.st.begun);
    MUST(HT_IS_PATTERN(*applied));
    MUST((d.out.start == applied->s[0]) && (applied->before == d.before));
    MUST(applied->s[1] == applied->s[2]);
    MUST(d.out.cb[leg_watched] == the_period.counts);
    MUST(HT_IS_COMPARE(d.out.ca[leg_watched], the_period));
    /* The register toggles the leg if and only if the words say so. */
    moves = d.out.ca[leg_watched] != the_period.counts;
    MUST(moves == (((applied->s[0] ^ applied->s[1]) & bit_watched) != 0u));
    MUST(moves || (d.toggles.t[leg_watched] == 1.0f));
    MUST((applied->later == (applied->s[0] ^ applied->s[1])) && (applied->close == 0u));
    /* Every edge is told, and no leg has one that is not there. */
    MUST((applied->rising | applied->falling) == ((d.before ^ applied->s[0]) | applied->later));
}

/* One leg's edges, and that the next decision finds them as this one did. */
void prove_interleaved_edges(void)
{
    a_decision d;
    a_past past = any_past();
    bool joined;
    bool brief;
    bool opposite;
    begin_decision(&d);
    GIVEN(((d.before & bit_watched) != 0u) == past.high);
    GIVEN(is_past(&d.st, &past));
    joined = d.st.positions.joined;
    brief = d.st.positions.brief;
    opposite = d.st.positions.opposite;
    decide(&d);
    does.turns = (d.st.positions.joined != joined) || (d.st.positions.brief != brief)
                 || (d.st.positions.opposite != opposite);
    does.high = (d.out.start & bit_watched) != 0u;
    does.ca = d.out.ca[leg_watched];
    MUST(may(&past, &does));
    MUST(IMPLIES(does.brief, does.begins && does.turns && (set_watched == 1u)));
    pass(&past, &does);
    MUST(is_past(&d.st, &past));
    MUST(past.high == ((d.applied.s[2] & bit_watched) != 0u));
}

#define DECISIONS 4u

/* A carrier's period of a leg, from where a half of its set begins, by what prove_interleaved_edges shows. */
void prove_interleaved_carrier(void)
{
    a_past past = any_past();
    unsigned halves = 0u;
    unsigned in_half = 0u;
    unsigned rises = 0u;
    unsigned falls = 0u;
    unsigned at_starts = 0u;
    bool turned = false; /* after the first decision */
    unsigned n;
    any_period();
    for (n = 0u; n < DECISIONS; n++) {
        a_step step;
        step.begins = nondet_bool();
        step.brief = nondet_bool();
        step.up = nondet_bool();
        step.turns = nondet_bool();
        step.bare = false;
        step.high = nondet_bool();
        step.ca = nondet_uint16();
        GIVEN(may(&past, &step) && ((n > 0u) || step.begins));
        GIVEN(IMPLIES(step.brief, step.begins && step.turns && (set_watched == 1u)));
        if (step.begins) {
            halves++;
            in_half = 0u;
        }
        if (toggles_in(&step)) {
            in_half++;
            rises += step.high ? 0u : 1u;
            falls += step.high ? 1u : 0u;
        }
        at_starts += (step.high != past.high) ? 1u : 0u;
        turned = turned || (((n > 0u) || step.brief) && step.turns);
        MUST(in_half <= 1u);
        pass(&past, &step);
    }
    MUST((at_starts <= halves) && ((rises + falls) <= halves));
    MUST(((set_watched == 1u) && turned) || ((halves <= 2u) && (rises <= 1u) && (falls <= 1u)));
}
