/* Carriers of both sets: the register of a leg, and the configuration. */
#include "ht_contracts.h"
#include "ht_interleaved.c"
#include "prove.h"

void prove_edge_counts(void)
{
    half_of h;
    ht_period p;
    bool brief = nondet_bool();
    uint32_t count;
    p.counts = nondet_uint16();
    p.first = 0u;
    p.shortest = nondet_uint16();
    GIVEN(HT_IS_PERIOD(p));
    h.end = p.counts;
    h.shortest = p.shortest;
    h.full = brief ? (float)(p.counts - 1u) : (2.0f * (float)p.counts);
    count = edge_counts(&h, nondet_float(), nondet_float());
    MUST(!brief || (count < p.counts));
    if ((count != 0u) && (count != 2u * (uint32_t)p.counts)) {
        uint32_t in_period = (count < p.counts) ? count : (count - p.counts);
        MUST(in_period < p.counts);
        MUST(HT_IS_COMPARE(in_period, p));
    }
}

void prove_interleaved_check(void)
{
    ht_interleaved_config cfg;
    cfg.alike = nondet_float();
    cfg.cap = nondet_float();
    cfg.together = nondet_uint16();
    cfg.kappa = nondet_float();
    cfg.kappa_from_pu = nondet_float();
    GIVEN(ht_interleaved_check(&cfg));
    MUST((cfg.alike >= -1.0f) && (cfg.alike <= 1.0f));
    MUST((cfg.cap > 0.0f) && (cfg.cap < 0.1f));
    MUST(cfg.together <= HT_TURN_CARRIERS);
    MUST((cfg.kappa >= 0.0f) && (cfg.kappa <= 1.0f) && (cfg.kappa_from_pu >= 0.0f));
}
