#include "ht_alignment.h"

/* The first direction is a quarter of a turn ahead of the last. */
#define ASIDE 3u
#define DIRECTIONS 12u
/* Share of the time for which the rotor is pulled aside. In its second half the swing is looked at. With
 * little friction it is still large, and where it happens to be at the end tells little. */
#define ASIDE_SHARE 0.4f
/* A rotor that moves by less than 1.5 degrees in a quarter of the time is at rest. */
#define REST_TURNS (1.0f / 240.0f)
/* Largest distance of a rotor at rest from the angle it was pulled to, electrical turns. A known angle
 * is up to 15 degrees from the nearest direction; friction may leave as much again. */
#define NEAR_TURNS (1.0f / 12.0f)

/* Nor does any rotor that swings turn further. An encoder that counts backwards makes what is to damp the swing
 * of a drive without a leg keep it up, and the rotor slowly goes round. */
#define MOST_TURNS 2

/* A rotor whose angle is known and right is no further from the direction than that while it swings. From
 * a wrong one the direct current pulls it there. */
#define AWAY_TURNS (1.0f / 6.0f)

static uint32_t share(uint32_t whole, float part)
{
    float counts = (float)whole * part;
    return (uint32_t)counts;
}

/* Shortest way from one angle to another. */
static int32_t way_to(uint32_t to, uint32_t from, uint32_t counts_rev)
{
    int32_t whole = (int32_t)counts_rev;
    int32_t way = (int32_t)to - (int32_t)from;
    if (way > (whole / 2)) {
        way -= whole;
    } else if (way < -(whole / 2)) {
        way += whole;
    } else {
        /* is the shortest */
    }
    return way;
}

static uint32_t apart(uint32_t a, uint32_t b, uint32_t counts_rev)
{
    int32_t way = way_to(a, b, counts_rev);
    return (uint32_t)((way < 0) ? -way : way);
}

/* Angle of a direction. */
static uint32_t angle_of(const ht_alignment_config *cfg, uint16_t direction)
{
    uint32_t parts = 2u * (uint32_t)direction;
    parts += cfg->first;
    return share(cfg->counts_rev, (1.0f / 24.0f) * (float)parts);
}

/* The direction next to an angle. */
static uint16_t nearest(const ht_alignment_config *cfg, uint32_t electrical)
{
    float turns = (float)electrical / (float)cfg->counts_rev;
    uint16_t half = (uint16_t)(1u - cfg->first);
    float steps = 12.0f * turns + 0.5f * (float)half;
    uint16_t direction = (uint16_t)steps;
    return (direction < DIRECTIONS) ? direction : 0u;
}

uint32_t ht_electrical(uint32_t electrical, int32_t moved, uint16_t pole_pairs, uint32_t counts_rev)
{
    int32_t whole = (int32_t)counts_rev;
    int32_t angle = (int32_t)electrical + (moved % whole) * (int32_t)pole_pairs;
    if ((angle < 0) || (angle >= whole)) { /* seldom: a division takes long */
        angle %= whole;
        angle += (angle < 0) ? whole : 0;
    }
    return (uint32_t)angle;
}

static void look(ht_alignment_state *st, uint32_t end)
{
    st->lookout = st->electrical;
    st->least = 0;
    st->most = 0;
    st->end = end;
}

void ht_alignment_begin(const ht_alignment_config *cfg, ht_alignment_state *st, uint16_t along)
{
    st->along = along;
    st->direction = (uint16_t)((along + ASIDE) % DIRECTIONS);
    if (cfg->known) {
        st->direction = nearest(cfg, st->electrical);
    }
    st->aside = st->electrical;
    st->before = st->electrical;
    st->travelled = 0;
    look(st, cfg->ticks);
}

/* For a rotor at rest: is it where it should be? */
static ht_alignment judged(const ht_alignment_config *cfg, ht_alignment_state *st)
{
    uint32_t near = share(cfg->counts_rev, NEAR_TURNS);
    uint32_t expected = angle_of(cfg, st->direction);
    if (!cfg->known) {
        uint32_t behind = st->aside + cfg->counts_rev - cfg->counts_rev / 4u;
        if (apart(st->electrical, behind % cfg->counts_rev, cfg->counts_rev) > near) {
            return HT_NOT_ALIGNED;
        }
        st->electrical = expected;
    }
    return (apart(st->electrical, expected, cfg->counts_rev) > near) ? HT_NOT_ALIGNED : HT_ALIGNED;
}

ht_alignment ht_alignment_step(const ht_alignment_config *cfg, ht_alignment_state *st,
                               uint32_t tick)
{
    uint32_t rest = share(cfg->counts_rev, REST_TURNS) + 2u * (uint32_t)cfg->pole_pairs;
    int32_t way = way_to(st->electrical, st->lookout, cfg->counts_rev);
    st->least = (way < st->least) ? way : st->least;
    st->most = (way > st->most) ? way : st->most;
    st->travelled += way_to(st->electrical, st->before, cfg->counts_rev);
    st->before = st->electrical;
    if ((st->travelled > MOST_TURNS * (int32_t)cfg->counts_rev)
        || (st->travelled < -MOST_TURNS * (int32_t)cfg->counts_rev)) {
        return HT_NOT_ALIGNED;
    }
    if (cfg->known
        && (apart(st->electrical, angle_of(cfg, st->direction), cfg->counts_rev)
            > share(cfg->counts_rev, AWAY_TURNS))) {
        return HT_NOT_ALIGNED;
    }
    if (!cfg->known && (tick == share(cfg->ticks, 0.5f * ASIDE_SHARE))) {
        look(st, cfg->ticks);
    }
    if (!cfg->known && (tick == share(cfg->ticks, ASIDE_SHARE))) {
        st->aside = ht_electrical(st->lookout, (st->least + st->most) / 2, 1u, cfg->counts_rev);
        st->direction = st->along;
    }
    if (tick == (cfg->ticks - cfg->ticks / 4u)) {
        look(st, cfg->ticks);
    }
    if (tick < st->end) {
        return HT_ALIGNING;
    }
    if (((uint32_t)st->most <= rest) && ((uint32_t)-st->least <= rest)) {
        return judged(cfg, st);
    }
    look(st, st->end + cfg->ticks / 4u);
    return (st->end > 4u * cfg->ticks) ? HT_NOT_ALIGNED : HT_ALIGNING;
}
