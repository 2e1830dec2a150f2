#include "ht_board.h"

/* Build option HT_GATES_ACTIVE_LOW (CMakeLists.txt): gate drivers that invert. */
#ifndef HT_GATES_ACTIVE_LOW
#define HT_GATES_ACTIVE_LOW 0
#endif

/* The shortest dead time. When a switch is told to go off, the other one of its leg must
 * wait until the first one is really off. An IGBT of 600 V or 1200 V and 10 A to 50 A is off
 * 0.3 us to 0.6 us after its gate (delay and fall time, hot). Two optocoupled gate drivers
 * of one type differ by up to 0.35 us. Together that is just below 1 us. A power stage with
 * slower switches needs more, one with faster switches (SiC, GaN) needs less: then change
 * this figure in the board's table, from the data sheets of switch and driver. */
#define IGBT_DEAD_MIN_US 1.0f

/* The shortest gate pulse. An IGBT of that size is fully on or off 0.3 us to 1 us after its gate, and the
 * diode that it takes the current from needs as long to recover. Gate drivers and modules ask for 0.5 us
 * to 1.5 us at least. Change it like the dead time, from the data sheets. */
#define IGBT_MIN_PULSE_US 2.0f

/* The comparators' DACs reach from 0 to VDDA, the ADC from 0 to V_REF. */
#define V_REF_PER_VDDA (3.0f / 3.3f)

#define SUBSYSTEMS 4u
#define NO_INPUT 0xFFFFu

uint16_t ht_board_cmpss(const ht_board *board, uint16_t channel)
{
    /* By subsystem: ADCINA2, ADCINA4, ADCINB2; the fourth's is ADCIN14, which both converters reach. */
    static const uint16_t positive_a[SUBSYSTEMS] = {2u, 4u, NO_INPUT, 14u};
    static const uint16_t positive_b[SUBSYSTEMS] = {NO_INPUT, NO_INPUT, 2u, 14u};
    /* ADC-B converts every second channel */
    const uint16_t *positive = ((channel & 1u) != 0u) ? positive_b : positive_a;
    uint16_t found = 0u;
    if (board->map->cmpss != 0u) {
        uint16_t n;
        for (n = 0u; n < SUBSYSTEMS; n++) {
            if (positive[n] == board->channel[channel]) {
                found = (uint16_t)(n + 1u);
            }
        }
    }
    return found;
}

const ht_board ht_board_f28335 = {
    .name = "f28335",
    .map = &ht_f28335,
    .pll_multiplier = 10u,
    .modules = 0x003Fu,
    .module = {0u, 1u, 2u, 3u, 4u, 5u},
    /* clang-format off */
    .pwm = {{0u, 1u}, {1u, 1u}, {2u, 1u}, {3u, 1u}, {4u, 1u}, {5u, 1u},
            {6u, 1u}, {7u, 1u}, {8u, 1u}, {9u, 1u}, {10u, 1u}, {11u, 1u}},
    /* clang-format on */
    .gates_active_low = (HT_GATES_ACTIVE_LOW != 0),
    .dead_min_us = IGBT_DEAD_MIN_US,
    .min_pulse_us = IGBT_MIN_PULSE_US,
    .trip = {12u, 1u},
    .eqep = 0u,
    .encoder_a = {20u, 1u},
    .encoder_b = {21u, 1u},
    .encoder_index = {23u, 1u},
    .receive = {28u, 1u},
    .transmit = {29u, 1u},
    .channel = {0u, 1u, 2u, 3u, 4u, 5u, 6u},
    .slow_channel = {7u, 8u}, /* A7 B0 */
    .baud = 921600u,          /* 937500: nothing nearer to 1.25 M comes out of 75 MHz */
    .output = {{13u, 0u}, {14u, 0u}, {15u, 0u}, {16u, 0u}},
};

const ht_board ht_board_f28377s = {
    .name = "f28377s",
    .map = &ht_f28377s,
    .pll_multiplier = 20u,
    .modules = 0x003Fu,
    .module = {0u, 1u, 2u, 3u, 4u, 5u},
    /* clang-format off */
    .pwm = {{0u, 1u}, {1u, 1u}, {2u, 1u}, {3u, 1u}, {4u, 1u}, {5u, 1u},
            {6u, 1u}, {7u, 1u}, {8u, 1u}, {9u, 1u}, {10u, 1u}, {11u, 1u}},
    /* clang-format on */
    .gates_active_low = (HT_GATES_ACTIVE_LOW != 0),
    .dead_min_us = IGBT_DEAD_MIN_US,
    .min_pulse_us = IGBT_MIN_PULSE_US,
    .dac_per_count = V_REF_PER_VDDA,
    .trip = {12u, 0u},
    .eqep = 0u,
    .encoder_a = {20u, 1u},
    .encoder_b = {21u, 1u},
    .encoder_index = {23u, 1u},
    .receive = {28u, 1u},
    .transmit = {29u, 1u},
    .channel = {2u, 2u, 3u, 3u, 4u, 4u, 14u}, /* A2 B2 A3 B3 A4 B4, ADCIN14 */
    .slow_channel = {5u, 5u},                 /* A5 B5 */
    .baud = 1250000u,                         /* exact */
    .output = {{13u, 0u}, {14u, 0u}, {15u, 0u}, {16u, 0u}},
};

/* GPIO0, 1 and 5..9 have no pin, and GPIO12 and 13, ePWM7, have the board's LEDs, which pull up while
 * the pins are inputs. So the legs are ePWM2, 6 and 8..11, and ePWM11's pins are not free for eQEP1;
 * ePWM1 keeps the time and starts the ADC all the same. */
const ht_board ht_board_launchxl_f28377s = {
    .name = "launchxl-f28377s",
    .map = &ht_f28377s,
    .pll_multiplier = 40u,
    .modules = 0x07FFu, /* the sync signal passes through 3, 4, 5 and 7 */
    .module = {1u, 5u, 10u, 7u, 8u, 9u},
    /* clang-format off */
    .pwm = {{2u, 1u}, {3u, 1u}, {10u, 1u}, {11u, 1u}, {20u, 5u}, {21u, 5u},
            {14u, 1u}, {15u, 1u}, {16u, 5u}, {17u, 5u}, {18u, 5u}, {19u, 5u}},
    /* clang-format on */
    .gates_active_low = (HT_GATES_ACTIVE_LOW != 0),
    .dead_min_us = IGBT_DEAD_MIN_US,
    .min_pulse_us = IGBT_MIN_PULSE_US,
    .dac_per_count = V_REF_PER_VDDA,
    /* GPIO0, 1, 5..9, 22..40, 44..57, 67, 68, 74..77, 79..83, 88, 93..98, 100..168 */
    .unbonded = {0xFFC003E3u, 0x03FFF1FFu, 0xE10FBC18u, 0xFFFFFFF7u, 0xFFFFFFFFu, 0x000001FFu},
    .trip = {4u, 0u},
    .eqep = 2u,
    .encoder_a = {62u, 5u},
    .encoder_b = {63u, 5u},
    .encoder_index = {65u, 5u},
    .receive = {85u, 5u},
    .transmit = {84u, 5u},
    .channel = {2u, 2u, 3u, 3u, 4u, 4u, 14u}, /* A2 B2 A3 B3 A4 B4, ADCIN14 */
    .slow_channel = {5u, 5u},                 /* A5 B5 */
    .baud = 1250000u,                         /* exact */
    .output = {{58u, 0u}, {59u, 0u}, {60u, 0u}, {61u, 0u}},
};
