#include "ht_contracts.h"
#include "ht_vsd.c"
#include "prove.h"

void prove_vsd_nan(void)
{
    ht_six s = any_six();
    ht_vsd v;
    unsigned leg = nondet_uint16();
    GIVEN((leg < 6u) && !is_finite(s.p[leg]));
    v = ht_vsd_from_six(&s);
    MUST(!is_finite(v.ab.alpha) || !is_finite(v.ab.beta));
}

void prove_vsd_bounded(void)
{
    ht_six s = any_six();
    ht_vsd v;
    int leg;
    for (leg = 0; leg < HT_LEGS; leg++) {
        GIVEN(HT_IS_WITHIN(s.p[leg], 1.0e6f));
    }
    v = ht_vsd_from_six(&s);
    MUST(HT_IS_WITHIN(v.ab.alpha, 1.3e6f) && HT_IS_WITHIN(v.ab.beta, 1.3e6f));
    MUST(HT_IS_XY_WITHIN(v.xy, 1.3e6f));
}
