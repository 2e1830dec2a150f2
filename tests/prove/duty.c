#include "ht_contracts.h"
#include "ht_duty.c"
#include "ht_tables.c"
#include "prove.h"

void prove_duty(void)
{
    unsigned group = nondet_uint16();
    unsigned k = nondet_uint16();
    ht_action_points p;
    GIVEN((group <= (unsigned)HT_ML) && HT_IS_SECTOR(k));
    p = ht_duty(group, k, any_xy());
    MUST(HT_ARE_ACTION_POINTS(p));
}
