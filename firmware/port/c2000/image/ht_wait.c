/* Busy waiting on the DSP. */
#include "ht_reg.h"

/* One turn takes at least 5 cycles; 200 MHz. */
#define TURNS_PER_US 40u

void ht_wait_us(uint16_t us)
{
    volatile uint32_t left = (uint32_t)us * TURNS_PER_US;
    while (left != 0u) {
        left--;
    }
}
