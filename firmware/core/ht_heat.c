#include "ht_heat.h"

#include "ht_limited.h"

/* The adapted R_s is not exact, and the model is left alone within what that makes of the temperature:
 * where R_s tells it while the drive runs (3.5 K were found), and after a build-up (8 K), which is short. */
#define TRUST_K 5.0f
#define BUILT_TRUST_K 10.0f
/* The temperature that R_s tells is followed so many times as quickly as the winding's heat goes to the frame: a wrong model pulls
 * its temperatures back. */
#define HEED 8.0f
/* R_s itself may be learnt up to this rise: what the model may be wrong by is small. */
#define COLD_K 15.0f

static void begin(ht_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->sum_A2[leg] = 0.0f;
    }
    st->frame_sum_W = 0.0f;
    st->summed = 0.0f;
    st->told_ohm = 0.0f;
    st->told = 0.0f;
}

/* The low passes are not the model's. */
static void cool(ht_heat_state *st)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->rise_K[leg] = 0.0f;
    }
    st->frame_rise_K = 0.0f;
    st->ohm_per_K = 0.0f;
    st->telling = 0.0f;
    st->measured = false;
    begin(st);
}

void ht_heat_reset(ht_heat_state *st)
{
    int leg;
    st->full = 0u;
    st->turns = 0.0f;
    st->gathered.turns = 0.0f;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->gathered.sum_A2[leg] = 0.0f;
        st->square_A2[leg] = 0.0f;
        st->more_A2[leg] = 0.0f;
    }
    cool(st);
}

HT_SELDOM void ht_heat_hand_over(ht_heat_state *st)
{
    int leg;
    st->handed = st->gathered;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->gathered.sum_A2[leg] = 0.0f;
    }
    st->gathered.turns = 0.0f;
    st->full = 1u; /* last: now the slow interrupt may begin */
}

/* Sums and turns have the same low pass, and the mean is their ratio. */
void ht_heat_take(const ht_heat_config *cfg, ht_heat_state *st)
{
    const ht_heat_samples *taken = &st->handed;
    float share = 0.0f;
    int leg;
    if (st->full == 0u) {
        return;
    }
    st->turns += cfg->sample_gain * (taken->turns - st->turns);
    if (st->turns > 0.0f) {
        share = cfg->sample_gain / st->turns;
    }
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->square_A2[leg] += share * (taken->sum_A2[leg] - taken->turns * st->square_A2[leg]);
    }
    st->full = 0u; /* last: now the fast interrupt may fill it */
}

float ht_heat_square_A2(const ht_heat_state *st, int leg)
{
    float sum_A2 = st->square_A2[leg] + st->more_A2[leg];
    return (sum_A2 > 0.0f) ? sum_A2 : 0.0f;
}

static float ohm_per_K(const ht_heat_config *cfg, const ht_heat_state *st)
{
    bool learnt = (cfg->rs_tells == (uint16_t)HT_RS_TELLS_RESISTANCE) && (st->ohm_per_K > 0.0f);
    return learnt ? st->ohm_per_K : cfg->ohm_per_K;
}

float ht_heat_rs_ohm(const ht_heat_config *cfg, const ht_heat_state *st)
{
    float sum_K = 0.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        sum_K += st->rise_K[leg];
    }
    return ohm_per_K(cfg, st) * (cfg->ambient_K + sum_K / (float)HT_LEGS);
}

/* The rise that R_s shows: of the parts, weighted by their squared currents. */
static float shown_K(const ht_heat_state *st)
{
    float squares_A2 = 0.0f;
    float sum = 0.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float square_A2 = ht_heat_square_A2(st, leg);
        squares_A2 += square_A2;
        sum += square_A2 * st->rise_K[leg];
    }
    return (squares_A2 > 0.0f) ? (sum / squares_A2) : 0.0f;
}

static void move(ht_heat_state *st, float by_K)
{
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        st->rise_K[leg] += by_K;
    }
    st->frame_rise_K += by_K;
}

/* R_s tells more than what it may be wrong by: take over this share of that. What a wrong temperature is
 * due to is not known; the ambient's, or the one at a reset, is common to both bodies. */
static void correct(const ht_heat_config *cfg, ht_heat_state *st, float rs_ohm, float share,
                    float trust_K)
{
    float off_K = rs_ohm / ohm_per_K(cfg, st) - cfg->ambient_K - shown_K(st);
    move(st, share * (off_K - ht_limited(off_K, trust_K)));
}

/* What R_s tells, over this share of a step. It is learnt once: later the model may be wrong, and R_s be
 * taken for what is heat. */
static void hear(const ht_heat_config *cfg, ht_heat_state *st, float rs_ohm, float share,
                 float trust_K)
{
    if ((cfg->rs_tells == (uint16_t)HT_RS_TELLS_TEMPERATURE) || (st->ohm_per_K > 0.0f)) {
        correct(cfg, st, rs_ohm, share, trust_K);
    } else if (shown_K(st) < COLD_K) {
        st->ohm_per_K = rs_ohm / (cfg->ambient_K + shown_K(st));
    } else {
        /* a warm winding of unknown resistance: R_s tells nothing */
    }
}

void ht_heat_built(const ht_heat_config *cfg, ht_heat_state *st, float rs_ohm)
{
    bool first = !(st->ohm_per_K > 0.0f);
    if (cfg->rs_tells == (uint16_t)HT_RS_TELLS_NOTHING) {
        return;
    }
    hear(cfg, st, rs_ohm, 1.0f, first ? 0.0f : BUILT_TRUST_K);
    if (cfg->rs_tells == (uint16_t)HT_RS_TELLS_TEMPERATURE) {
        st->ohm_per_K = cfg->ohm_per_K; /* no longer the first */
    }
}

void ht_heat_measured(const ht_heat_config *cfg, ht_heat_state *st, float winding_degC)
{
    float off_K = winding_degC - cfg->ambient_degC - st->rise_K[0];
    move(st, st->measured ? (cfg->heed * off_K) : off_K);
    st->measured = true;
}

/* Both bodies at once, from the means of the losses since the latest step. */
static void step(const ht_heat_config *cfg, ht_heat_state *st)
{
    float mean = 1.0f / st->summed;
    float per_K = ohm_per_K(cfg, st);
    float frame_K = st->frame_rise_K;
    float above_K = 0.0f;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        float rise_K = st->rise_K[leg];
        float loss_W = per_K * (cfg->ambient_K + rise_K) * st->sum_A2[leg] * mean;
        above_K += rise_K - frame_K;
        st->rise_K[leg] += cfg->per_W_K * loss_W - cfg->to_frame * (rise_K - frame_K);
    }
    st->frame_rise_K += cfg->frame_per_W_K * st->frame_sum_W * mean + cfg->frame_per_rise * above_K
                        - cfg->to_ambient * frame_K;
}

/* R_s, or 0 where it is not exact: the adaptation needs time until it is. */
static void listen(const ht_heat_config *cfg, ht_heat_state *st, float rs_ohm)
{
    if (!(rs_ohm > 0.0f)) {
        st->telling = 0.0f;
    } else if (st->telling < cfg->settled) {
        st->telling += 1.0f;
    } else {
        st->told_ohm += rs_ohm;
        st->told += 1.0f;
    }
}

void ht_heat_step(const ht_heat_config *cfg, ht_heat_state *st, bool powered, float frame_W,
                  float rs_ohm)
{
    if (!(cfg->steps > 0.0f)) {
        if (!cfg->sensed) {
            cool(st);
        }
        return;
    }
    if (powered) {
        int leg;
        for (leg = 0; leg < HT_LEGS; leg++) {
            st->sum_A2[leg] += ht_heat_square_A2(st, leg);
        }
        st->frame_sum_W += frame_W;
    }
    listen(cfg, st, rs_ohm);
    st->summed += 1.0f;
    if (st->summed >= cfg->steps) {
        step(cfg, st);
        if (st->told > 0.0f) {
            hear(cfg, st, st->told_ohm / st->told,
                 ht_limited(HEED * cfg->to_frame * (st->told / st->summed), 1.0f), TRUST_K);
        }
        begin(st);
    }
}

float ht_heat_winding_degC(const ht_heat_config *cfg, const ht_heat_state *st)
{
    float most_K = st->rise_K[0];
    int leg;
    for (leg = 1; leg < HT_LEGS; leg++) {
        most_K = (st->rise_K[leg] > most_K) ? st->rise_K[leg] : most_K;
    }
    return cfg->ambient_degC + most_K;
}

float ht_heat_left(float degC, float limit_degC, float trip_degC)
{
    if (degC <= limit_degC) {
        return 1.0f;
    }
    return (degC >= trip_degC) ? 0.0f : ((trip_degC - degC) / (trip_degC - limit_degC));
}

float ht_heat_share(const ht_heat_config *cfg, float winding_degC)
{
    bool watched = (cfg->steps > 0.0f) || cfg->sensed;
    return watched ? ht_heat_left(winding_degC, cfg->limit_degC, cfg->trip_degC) : 1.0f;
}
