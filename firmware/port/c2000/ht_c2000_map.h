/** @file ht_c2000_map.h
 *  The differences between the devices: word addresses, offsets and clocks that the shared drivers
 *  use, and flags for what only some devices have. The drivers check these flags, never which
 *  device it is. Registers that only one kind of device has are in the driver that uses them. Names
 *  are TI's. Sources: TMS320x2833x and TMS320F2837xS technical reference manuals and data sheets.
 */
#ifndef HT_C2000_MAP_H
#define HT_C2000_MAP_H

#include <stdbool.h>
#include <stdint.h>

/** Channels of the conversion sequence: six currents in phase order, Vdc. */
#define HT_MAP_CHANNELS 7
/** And slow ones: thermistors of winding and heat sink. */
#define HT_MAP_SLOW_CHANNELS 2

/** HT_DEVICE_<name> of every chip, in the order of ht_chips.def; HT_DEVICES is their number. */
typedef enum {
#define HT_CHIP(name, family) HT_DEVICE_##name,
#define HT_CHIP_BOARD(chip, name)
#include "ht_chips.def"
#undef HT_CHIP
#undef HT_CHIP_BOARD
    HT_DEVICES
} ht_device;

/** `epwm` + module * `stride` + offset addresses a PWM register (module 0 = ePWM1).
 *  An offset of 0xFFFF = not present. */
typedef struct {
    ht_device device;     /**< its row in ht_chips.def; no driver asks for it */
    bool clock_pllcr;     /**< clocks by PLLCR and PCLKCR (ht_clock_f28335.c), else by CLKCFG
                               *   and CPUSYS (ht_clock_f28377s.c) */
    bool flash_cached;    /**< flash with cache, prefetch, ECC and a pump of its own, else with
                               *   wait states alone */
    bool gpio_groups;     /**< the multiplexers have a second level, GPyGMUX */
    bool adc_sequencer;   /**< one converter whose sequencer is reset before every sequence,
                               *   else ADC-A and ADC-B side by side */
    uint32_t trip_select; /**< INPUT1SELECT: which pin trips; 0: the pin is fixed */
    uint32_t epwm;
    uint16_t stride;
    uint16_t tbctl;
    uint16_t tbctr;
    uint16_t tbprd;
    uint16_t tbphs;
    uint16_t cmpctl;
    uint16_t cmpa;
    uint16_t cmpb;
    uint16_t aqctl;
    uint16_t aqctla;
    uint16_t aqsfrc;
    uint16_t aqcsfrc;
    uint16_t dbctl;
    uint16_t dbred;
    uint16_t dbfed;
    uint16_t tzsel;
    uint16_t tzctl;
    uint16_t tzflg;
    uint16_t tzclr;
    uint16_t tzfrc;
    uint16_t one_shot; /**< TZSEL: what trips all legs for good */
    uint16_t etsel;
    uint16_t etps;
    uint32_t adc_result[HT_MAP_CHANNELS];
    uint32_t adc_slow_result[HT_MAP_SLOW_CHANNELS];
    uint32_t adc_slow_select; /**< ADCCHSELSEQ2, where they take turns; 0xFFFF: they do not */
    uint16_t adc_shift;       /**< right shift to 12-bit counts */
    uint32_t adc_flag;        /**< end of the sequence: register ... */
    uint16_t adc_flag_bit;    /**< ... and bit that shows it, */
    uint32_t adc_clear;       /**< register ... */
    uint16_t adc_clear_bit;   /**< ... and bit that clears it */
    uint32_t adc_commands;    /**< ADCTRL2: commands of the ADC's sequencer; 0xFFFF: has none */
    uint32_t ecap;            /**< eCAP1, which trips through the X-BAR; 0: it cannot */
    uint32_t cmpss;           /**< CMPSS1, over-current by hardware; 0: has no comparators */
    uint32_t eqep;            /**< eQEP1 */
    uint32_t sci;             /**< SCI-A */
    uint32_t gpio;            /**< control registers of port A */
    uint16_t gpio_stride;     /**< to the next port */
    uint32_t gpio_data;       /**< GPADAT: levels of the pins of port A */
    uint16_t vectors;         /**< entries of the PIE vector table */
    uint16_t dead_max_counts;
    float pwm_clock_Hz;
    uint16_t encoder_qualprd; /**< half the sampling period of the encoder's pins, clocks */
    float system_clock_Hz;    /**< SYSCLKOUT: clocks CPU timers and eQEP */
    uint32_t reset_cause;  /**< RESC; 0: WDCR's WDFLAG tells a watchdog's reset, and nothing else */
    float watchdog_Hz;     /**< its counter's clock before the prescaler */
    uint32_t sci_clock_Hz; /**< LSPCLK */
} ht_c2000_map;

/* The maps of all chips: ht_f28335 ... */
#define HT_CHIP(name, family) extern const ht_c2000_map ht_##name;
#define HT_CHIP_BOARD(chip, name)
#include "ht_chips.def"
#undef HT_CHIP
#undef HT_CHIP_BOARD

#endif
