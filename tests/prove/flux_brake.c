#include "ht_contracts.h"
#include "ht_flux_brake.c"
#include "prove.h"

void prove_flux_brake(void)
{
    ht_flux_brake_config c;
    ht_flux_brake_state st;
    ht_flux_brake_input in;
    float normal = nondet_float();
    float got;
    c.most_Wb = nondet_float();
    c.raise_Wb = nondet_float();
    c.hold = nondet_float();
    c.per_check = nondet_float();
    st.left = nondet_float();
    in.limits = nondet_bool();
    in.may = nondet_bool();
    in.torque_share = nondet_float();
    in.flux_Wb = nondet_float();
    in.along_A = nondet_float();
    in.most_A = nondet_float();
    in.off2 = nondet_float();
    in.turns_V = nondet_float();
    in.omega_rad_s = nondet_float();
    GIVEN((c.raise_Wb >= 0.0f) && (c.raise_Wb <= 0.5f * c.most_Wb) && (c.most_Wb <= 150.0f));
    GIVEN((c.hold >= 0.0f) && (c.hold <= 1.0e6f));
    GIVEN((st.left >= 0.0f) && (st.left <= c.hold));
    GIVEN((normal >= 0.0f) && (normal <= 150.0f));
    got = ht_flux_brake_step(&c, &st, &in, normal);
    MUST((got == normal) || ((got > normal) && (got <= c.most_Wb)));
    MUST(IMPLIES(!in.may || (c.raise_Wb == 0.0f), (got == normal) && (st.left == 0.0f)));
    MUST((st.left >= 0.0f) && (st.left <= c.hold));
}
