/* A capture is armed only if it fits. */
#include "ht_burst.c"
#include "prove.h"

void prove_burst_arm(void)
{
    ht_burst b;
    ht_burst_setup setup;
    ht_burst_answer answer;
    uint16_t before;
    b.size = nondet_uint32();
    b.state = nondet_uint16();
    b.number = nondet_uint16();
    before = b.state;
    setup.n = nondet_uint16();
    setup.trigger = nondet_uint16();
    setup.prescaler = nondet_uint16();
    setup.samples = nondet_uint32();
    setup.before = nondet_uint32();
    setup.level = nondet_float();
    answer = ht_burst_arm(&b, &setup);
    MUST((unsigned)answer <= (unsigned)HT_BURST_TOO_LARGE);
    MUST(IMPLIES(setup.n == 0u, answer == HT_BURST_BAD_N));
    MUST(IMPLIES(answer != HT_BURST_ARMED, b.state == before));
    if (answer == HT_BURST_ARMED) {
        MUST((setup.n >= 1u) && (setup.n <= HT_BURST_CHANNELS) && (setup.prescaler >= 1u));
        MUST((setup.trigger < (uint16_t)HT_TRIGGERS) && !is_nan(setup.level));
        MUST(setup.before < setup.samples);
        MUST(setup.samples <= (b.size / setup.n)); /* so their product is at most the size */
        MUST((b.state == (uint16_t)HT_BURST_WAITING) || (b.state == (uint16_t)HT_BURST_FILLING));
    }
}
