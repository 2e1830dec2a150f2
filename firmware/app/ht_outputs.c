#include "ht_outputs.h"

#include "port.h"

#include <math.h>

/* A voltage that moves by less than this share of the level, within the time for which it must stand,
 * stands. A link with a time constant of ten such times then lacks a tenth of its source. */
#define STANDS 0.01f
/* The torque is there from this share on, in so many slow interrupts in a row. */
#define BUILT 0.9f
#define BUILT_TICKS 3.0f

void ht_outputs_reset(ht_outputs_state *st)
{
    st->on = 0u;
    st->vdc_V = 0.0f;
    st->stood = 0.0f;
    st->fan_for = 0.0f;
    ht_outputs_drop(st);
}

/* Follow the voltage. Returns whether the relay is to be closed. */
static bool bridges(const ht_outputs_config *cfg, ht_outputs_state *st, float vdc_V)
{
    bool closed = (st->on & (uint16_t)HT_OUT_PRECHARGE) != 0u;
    bool stands = (vdc_V > cfg->precharge_V)
                  && (fabsf(vdc_V - st->vdc_V) < STANDS * cfg->precharge_V);
    if (!(cfg->precharge_V > 0.0f) || !(vdc_V >= cfg->rearm_V) || (!closed && !stands)) {
        st->vdc_V = vdc_V;
        st->stood = 0.0f;
        return false;
    }
    if (!(st->stood > 2.0f * cfg->stands)) {
        st->stood += 1.0f;
    }
    return st->stood > cfg->stands;
}

bool ht_outputs_charged(const ht_outputs_config *cfg, const ht_outputs_state *st)
{
    return !(cfg->precharge_V > 0.0f) || (st->stood > 2.0f * cfg->stands);
}

uint16_t ht_outputs_step(const ht_outputs_config *cfg, ht_outputs_state *st, float vdc_V,
                         bool works)
{
    unsigned on = bridges(cfg, st, vdc_V) ? (unsigned)HT_OUT_PRECHARGE : 0u;
    if (works) {
        st->fan_for = cfg->fan_after;
    } else if (st->fan_for > 0.0f) {
        st->fan_for -= 1.0f;
    } else {
        /* it is off */
    }
    if ((cfg->fan_after > 0.0f) && (st->fan_for > 0.0f)) {
        on |= (unsigned)HT_OUT_FAN;
    }
    return (uint16_t)on;
}

bool ht_outputs_chops(const ht_outputs_config *cfg, bool on, float vdc_V)
{
    return vdc_V > (on ? cfg->chopper_off_V : cfg->chopper_on_V);
}

static void enter(ht_outputs_state *st, ht_brake brake)
{
    st->brake = (uint16_t)brake;
    st->brake_for = 0.0f;
}

void ht_outputs_drop(ht_outputs_state *st)
{
    enter(st, HT_BRAKE_BUILDS);
}

bool ht_outputs_lifted(const ht_outputs_config *cfg, const ht_outputs_state *st)
{
    return (cfg->opens > 0.0f)
           && ((st->brake == (uint16_t)HT_BRAKE_OPENS) || (st->brake == (uint16_t)HT_BRAKE_OPEN));
}

ht_brake ht_outputs_brake(const ht_outputs_config *cfg, ht_outputs_state *st, float torque_Nm,
                          bool follows)
{
    float along_Nm = (cfg->hold_Nm < 0.0f) ? -torque_Nm : torque_Nm;
    if (!(cfg->opens > 0.0f)) {
        return HT_BRAKE_OPEN;
    }
    st->brake_for += 1.0f;
    switch ((ht_brake)st->brake) {
    case HT_BRAKE_BUILDS:
        if ((cfg->hold_Nm != 0.0f) && !(along_Nm >= BUILT * fabsf(cfg->hold_Nm))) {
            st->brake_for = 0.0f;
        } else if (follows && (st->brake_for >= BUILT_TICKS)) {
            enter(st, HT_BRAKE_OPENS);
        } else {
            /* a few samples more */
        }
        break;
    case HT_BRAKE_OPENS:
        if (st->brake_for > cfg->opens) {
            enter(st, HT_BRAKE_OPEN);
        }
        break;
    case HT_BRAKE_CLOSES:
        if (st->brake_for > cfg->closes) {
            enter(st, HT_BRAKE_CLOSED);
        }
        break;
    case HT_BRAKE_CLOSED:
        if (follows) { /* the stop was taken back */
            enter(st, HT_BRAKE_BUILDS);
        }
        break;
    case HT_BRAKE_OPEN:
    default:
        break;
    }
    return (ht_brake)st->brake;
}

bool ht_outputs_close(const ht_outputs_config *cfg, ht_outputs_state *st)
{
    if (ht_outputs_lifted(cfg, st)) {
        enter(st, HT_BRAKE_CLOSES);
    }
    return !(cfg->opens > 0.0f) || (st->brake == (uint16_t)HT_BRAKE_CLOSED)
           || (st->brake == (uint16_t)HT_BRAKE_BUILDS);
}
