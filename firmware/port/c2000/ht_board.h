/** @file ht_board.h
 *  The boards: crystal, pins, channels, and the requirements of the power stage. The same tables in
 *  words: docs/first-spin.md.
 */
#ifndef HT_BOARD_H
#define HT_BOARD_H

#include "ht_c2000_map.h"
#include "ht_types.h"
#include "port.h"

/** GPIO ports that a board's table speaks of. */
#define HT_PORTS 6

/** A pin, and the position of its multiplexer that selects its function. */
typedef struct {
    uint16_t gpio;
    uint16_t mux; /**< 0..3 on the F28335, 0..15 on the F28377S */
} ht_pin;

typedef struct {
    const char *name;
    const ht_c2000_map *map;
    uint16_t pll_multiplier;  /**< crystal to twice SYSCLKOUT */
    uint16_t modules;         /**< ePWM modules with a clock: bit 0 = ePWM1 */
    uint16_t module[HT_LEGS]; /**< of each leg, 0 = ePWM1 */
    ht_pin pwm[2 * HT_LEGS];  /**< upper, lower switch of each leg */
    bool gates_active_low;    /**< the gate drivers invert: a low pin switches on */
    float dead_min_us;        /**< shortest dead time that the power stage allows */
    float min_pulse_us;       /**< shortest gate pulse that it allows */
    float dac_per_count; /**< steps of the comparators' DACs in a count of the ADC: V_REF / VDDA */
    /** Pins of each port that the package does not bring out, ports A to F: they get pull-ups, because a
     *  floating input may draw current. */
    uint32_t unbonded[HT_PORTS];
    ht_pin trip;   /**< low trips all legs */
    uint16_t eqep; /**< eQEP module of the encoder, 0 = eQEP1 */
    ht_pin encoder_a;
    ht_pin encoder_b;
    ht_pin encoder_index;
    ht_pin receive;
    ht_pin transmit;
    /** ADC inputs. F28377S: u1 w1 v1 and Vdc are ADC-A's, u2 w2 v2 ADC-B's, one of each at a
     *  time. ADCINA0, A1 and B1 have a pull-down of 50 kohm, B0 a capacitor: not for currents. */
    uint16_t channel[HT_MAP_CHANNELS];
    /** Thermistors of winding and heat sink. F28377S: ADC-A's and ADC-B's. */
    uint16_t slow_channel[HT_MAP_SLOW_CHANNELS];
    uint32_t baud; /**< of the link */
    ht_pin output
        [HT_OUTPUTS]; /**< precharge relay, brake, fan, chopper: high is on. A resistor pulls each
                       *   down. */
} ht_board;

/** Comparator subsystem, 1 ... 4, whose positive input is the pin of this channel (below
 *  HT_MAP_CHANNELS) of the board; 0: none. */
uint16_t ht_board_cmpss(const ht_board *board, uint16_t channel);

/* All boards: ht_board_f28335 ... */
#define HT_CHIP(name, family)
#define HT_CHIP_BOARD(chip, name) extern const ht_board ht_board_##name;
#include "ht_chips.def"
#undef HT_CHIP
#undef HT_CHIP_BOARD

#endif
