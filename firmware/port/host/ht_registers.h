/** @file ht_registers.h
 *  What the register model knows of a chip: tables of modules and registers, worked
 *  out from TI's manuals independently of the drivers' own map.
 */
#ifndef HT_REGISTERS_H
#define HT_REGISTERS_H

#include <stdint.h>

/** The effect of a write. From HT_FX_... on: stored like a plain one, with an effect
 *  (ht_regfile_effects.c). */
typedef enum {
    HT_PLAIN = 0,
    HT_READ_ONLY,
    HT_ONES_CLEAR,    /**< ones clear bits of the register itself */
    HT_ONES_CLEAR_AT, /**< ... of the register at offset `at`; reads 0 */
    HT_ONES_SET_AT,   /**< ones set bits there; reads 0 */
    HT_FX_CLOCKS,     /**< module clocks: act after the next HT_SETTLE */
    HT_FX_WDKEY,
    HT_FX_WDCR,
    HT_FX_WDCNTR,
    HT_FX_PLLSTS, /**< F28335 */
    HT_FX_PLLCR,
    HT_FX_OSCSEL, /**< F28377S */
    HT_FX_PLLCTL,
    HT_FX_PLLMULT,
    HT_FX_PLLLOCK,
    HT_FX_MCDCR,
    HT_FX_PUMP,
    HT_FX_FLASH,
    HT_FX_RWAIT,
    HT_FX_MUX,
    HT_FX_GMUX,
    HT_FX_ADCTRL2,
    HT_FX_ADCTRL3,
    HT_FX_ADCST,
    HT_FX_ADCCTL1,
    HT_FX_ADCINTFLGCLR,
    HT_FX_TSCTR,
    HT_FX_QCAPCTL,
    HT_FX_TCR,
    HT_FX_COUNTING, /**< CPU timers 1 and 2: TCR */
    HT_FX_COUNT,    /**< ... and TIM */
    HT_FX_SCIFORMAT,
    HT_FX_SCICTL1,
    HT_FX_SCITXBUF,
    HT_FX_SCIRXBUF,
    HT_FX_SCIFFTX,
    HT_FX_SCIFFRX,
    HT_FX_PIE,
    HT_FX_PIEACK
} ht_what;

#define HT_EALLOWED 0x0001u    /**< protected: needs EALLOW */
#define HT_SET_UP 0x0002u      /**< ePWM: counters stopped and the module tripped */
#define HT_TRIP_SET_UP 0x0004u /**< ePWM: counters stopped */
#define HT_TRIP_ACTION 0x0008u /**< ePWM: TZCTL (ht_model_check_action) */

typedef struct {
    const char *name;
    uint16_t offset; /**< words from the module's first register */
    uint16_t bits;   /**< 16 or 32: the only width it may be accessed with */
    uint32_t reset;
    uint32_t writable; /**< the other bits are reserved or the hardware's */
    ht_what what;
    uint16_t flags;
    uint16_t at;
    const char *fields; /**< "15-14 FREE_SOFT, 13 PHSDIR, ..." */
} ht_register;

typedef struct {
    const char *name;
    uint32_t base;
    uint16_t stride;   /**< to the next instance */
    uint16_t count;    /**< instances; more than one are numbered */
    uint16_t first;    /**< ... from here on */
    uint32_t gate;     /**< register with the clock enable, 0 = always clocked */
    uint16_t gate_bit; /**< of the first instance, the next ones follow */
    const ht_register *registers;
    uint16_t length;
} ht_module;

typedef struct {
    const ht_module *modules;
    uint16_t length;
    uint32_t sync; /**< register with TBCLKSYNC */
    uint16_t sync_bit;
    uint32_t epwm; /**< ePWM1, distance to the next one, and offsets */
    uint16_t epwm_stride;
    uint16_t tzsel;
    uint16_t tzctl;
    uint16_t tzeint;
    uint16_t tzflg;
    uint16_t dbctl;
    uint16_t dbred;
    uint16_t dbfed;
    uint16_t etsel;
    uint16_t etps;
    uint32_t gpio; /**< port A, distance to the next port */
    uint16_t gpio_stride;
    uint32_t gpio_data;     /**< levels of port A; the next port's are 8 words further */
    uint32_t adc_flag;      /**< where the end of a sequence shows (bit 0) */
    uint32_t adc_settle_us; /**< from power-up to the first conversion */
    float watchdog_Hz;      /**< its clock / 512 */

    /* The differences between the chips: a flag is 1 for a chip that has it, an address 0 for a
     * chip without it. */
    uint32_t pll_multiplier;       /**< register that holds it */
    uint16_t internal_oscillators; /**< two of them, which may clock system, timers and watchdog */
    float crystal_Hz;              /**< as the boards have it; 0: it depends on the board, ... */
    float crystal_pll_Hz;          /**< ... which chooses crystal x multiplier to be this */
    float first_crystal_Hz;        /**< before a multiplier is chosen */
    uint16_t pin_groups;           /**< second level of the pins' multiplexers, GPyGMUX */
    uint32_t pwm_pins;             /**< pins 0 ... of PWM modules at position 1, two per module */
    uint32_t pwm_pins_group;    /**< pins 16 ... of PWM modules at position 5: the last, plus 1 */
    uint32_t trip_select;       /**< INPUT1SELECT: the pin that trips */
    uint32_t trip_pin;          /**< that pin, where it is fixed */
    uint16_t trips_without_pin; /**< clock failure and emulation stop trip by themselves */
    uint16_t sequencer;         /**< one ADC with a sequencer; else two, with a start per result */
    uint32_t ecap;              /**< eCAP1, which reaches the trip zones through the X-BAR */
    uint32_t cmpss;             /**< CMPSS1, the comparators */
    uint32_t sci;               /**< SCI-A */
    uint32_t adc_cal;           /**< TI's functions in OTP: calibration of the one ADC, ... */
    uint32_t device_cal;        /**< ... of the device, ... */
    uint32_t linearity_trim[2]; /**< ... of ADC-A's and ADC-B's linearity, ... */
    uint32_t offset_trim;       /**< ... and the offset that fits */
} ht_chip;

/** The maps of the families of chips (ht_chips.def). */
extern const ht_chip ht_chip_f28335;
extern const ht_chip ht_chip_f28377s;

/** The same on both chips. */
#define HT_EQEP_REGISTERS 24
#define HT_SCI_REGISTERS 13
#define HT_TIMER_REGISTERS 5
#define HT_PIE_REGISTERS 26
extern const ht_register ht_registers_eqep[HT_EQEP_REGISTERS];
extern const ht_register ht_registers_sci[HT_SCI_REGISTERS];
extern const ht_register ht_registers_timer[HT_TIMER_REGISTERS];
/** CPU timers 1 and 2, which count. */
extern const ht_register ht_registers_counter[HT_TIMER_REGISTERS];
/** Interrupt controller: 8 or 16 interrupts a group. */
extern const ht_register ht_registers_pie_8[HT_PIE_REGISTERS];
extern const ht_register ht_registers_pie_16[HT_PIE_REGISTERS];
extern const ht_register ht_register_vector[1];

/* Table rows: plain, with flags, ... */
#define REG(name, offset, reset, writable, what, flags, at, fields) \
    {name, offset, 16u, reset, writable, what, flags, at, fields}
#define REG32(name, offset, reset, writable, what, flags, at, fields) \
    {name, offset, 32u, reset, writable, what, flags, at, fields}

#endif
