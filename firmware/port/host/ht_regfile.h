/** @file ht_regfile.h
 *  Model of a C2000 chip as its drivers see it, one per simulated drive. It reproduces the effect
 *  of every access, traps included.
 *
 *  Modelled: reset values; EALLOW; write-1-to-clear, force and read-only registers;
 *  reserved bits; access width; module clocks (a write to a module without clock is
 *  lost; an enable acts after HT_SETTLE); watchdog keys and time; the PLLs' sequences;
 *  flash pump; pin multiplexers; the ADC's power-up and sequencer, and how its interrupts
 *  can stop for good; CPU timers; SCI-A with its FIFOs; PIE group 1 with vectors, nesting
 *  and acknowledge; INT13 of CPU timer 1; eCAP1's output, through the X-BAR and the digital
 *  compare to a trip; the comparators (CMPSS) on the same way, with their filters; TI's functions in OTP; levels of the pins, and a trip that comes back
 *  as long as its pin is low. An access that the chip refuses, or that the manual forbids at
 *  this point, is counted as a violation, and the first ones are kept: tests require zero. A
 *  register that the tables do not list counts as absent.
 *
 *  The PWM's outputs are not modelled here: the plant derives them from the registers.
 */
#ifndef HT_REGFILE_H
#define HT_REGFILE_H

#include <stdint.h>

#include "ht_registers.h"

#define HT_REGFILE_LOW 0x8000u /* words 0x0000..0x7FFF, then the windows above them */
#define HT_REGFILE_WORDS 0x8C20u
#define HT_REGFILE_BOUND 1500
#define HT_REGFILE_GATES 50
#define HT_REGFILE_COMPARATORS 8
#define HT_REGFILE_LOG 16
#define HT_REGFILE_VECTORS 224
#define HT_REGFILE_ISRS 8
#define HT_REGFILE_FIFO 16
#define HT_REGFILE_LINE 64
/** Not the chip's: a plant's absolute encoder, its reading plus 1 (32 bits), 0 without one. The words are
 *  RAM there, of which the model has no register. */
enum { HT_REGFILE_ABSOLUTE = 0x0400 };
#define HT_REGFILE_DEVICE_CAL 0x070282u /* TI's Device_cal, F28377S */

/** Kinds of violation. */
enum {
    HT_REG_OK = 0,
    HT_REG_NO_EALLOW = 1,
    HT_REG_HOLE = 2, /**< no such register */
    HT_REG_READ_ONLY = 3,
    HT_REG_RESERVED = 4,  /**< a one in a reserved bit */
    HT_REG_WIDTH = 5,     /**< 16 bits of a 32-bit register or the other way round */
    HT_REG_UNCLOCKED = 6, /**< its module has no clock (yet) */
    HT_REG_ORDER = 7,     /**< forbidden at this point */
    HT_REG_KEY = 8,       /**< wrong key */
    HT_REG_WATCHDOG = 9   /**< the watchdog has reset the chip */
};

/** A register of the table at its place on the chip. */
typedef struct {
    const ht_register *reg;
    const ht_module *module;
    uint32_t base;    /* of the instance */
    uint16_t number;  /* of the instance */
    uint16_t gate;    /* its module's clock, in `gate` */
    uint16_t written; /* 1 once it has been written */
} ht_bound;

typedef struct {
    uint32_t address;
    uint16_t bit;
    uint16_t on;
} ht_gate;

typedef struct {
    uint32_t address;
    uint32_t value;
    uint16_t kind;
    const char *why;
} ht_violation;

typedef struct ht_regfile {
    uint16_t word[HT_REGFILE_WORDS];
    uint16_t open[HT_REGFILE_WORDS];  /* bits that may be stored without further ado */
    uint16_t index[HT_REGFILE_WORDS]; /* 1 + number in `bound`; bit 15: may just be read */
    ht_bound bound[HT_REGFILE_BOUND];
    ht_gate gate[HT_REGFILE_GATES]; /* gate 0 = always on */
    uint16_t bound_count;
    uint16_t gate_count;
    const void *map; /* ht_c2000_map of the device */
    const ht_chip *chip;
    uint16_t eallow;           /* 1 while protected writes are allowed */
    uint16_t gates_active_low; /* the gate drivers invert; after a reset as built */
    uint32_t accesses;         /* all reads and writes */
    uint32_t event_at;         /* a conversion sequence ends before this access; 0 = never */
    uint16_t event_timer;      /* 1: it is CPU timer 0 instead */
    uint32_t ended_at;         /* access before which a sequence ended last */
    uint32_t violations;
    uint32_t first_address; /* of the first violation */
    uint16_t first_kind;
    ht_violation log[HT_REGFILE_LOG]; /* the first ones */
    /* CPU and interrupts */
    uint16_t intm; /* 1: interrupts masked */
    uint16_t ier;
    void (*vector[HT_REGFILE_VECTORS])(void);
    void (*isr[HT_REGFILE_ISRS])(void); /* those in `vector`, in the order of their coming */
    uint32_t acknowledged_at;           /* access that acknowledged at the PIE, until a NOP */
    uint16_t depth;                     /* interrupts within interrupts */
    uint16_t deepest;
    /* Time and watchdog */
    uint32_t time_us;
    uint32_t dog_us;    /* when it was serviced last */
    uint16_t dog_armed; /* the first key has been written */
    uint32_t dog_services;
    uint32_t dog_resets;
    /* Dead-man timers */
    uint16_t lost;      /* planted: the end of a sequence raises no interrupt */
    uint16_t int13;     /* CPU timer 1 has asked for its interrupt */
    uint32_t timer1;    /* clocks since CPU timer 1 was reloaded */
    uint16_t ecap_high; /* eCAP1's output */
    /* Comparators: outputs to the X-BAR, bit 0 high, bit 1 low, and how long each input has been beyond */
    uint16_t trips[HT_REGFILE_COMPARATORS];
    uint32_t beyond_ns[HT_REGFILE_COMPARATORS][2];
    /* PLL and crystal */
    uint16_t looks; /* at the lock flag until it shows */
    uint16_t locks;
    uint16_t never_locks;   /* planted: it does not */
    uint16_t slips;         /* planted: it slips */
    uint16_t wrong_locks;   /* planted: so many locks are at a wrong frequency, ... */
    uint16_t wrong_percent; /* ... which is this much of the right one */
    uint16_t no_crystal;    /* planted */
    float crystal_Hz;       /* 0: the one that the multiplier is meant for */
    float pll_share;        /* of the right frequency, of the latest lock */
    uint32_t timer_at[2];   /* CPU timers 1, 2: access that started them; 0 = stopped */
    /* ADC; a bit for each converter */
    uint16_t device_calibrated; /* F28377S: Device_cal has run */
    uint16_t calibrated;
    uint16_t powered;
    uint32_t powered_us;
    uint16_t stands; /* F28335: the sequencer stands at its end */
    /* SCI */
    uint16_t sci_in[HT_REGFILE_FIFO];
    uint16_t sci_in_count;
    uint16_t sci_out[HT_REGFILE_FIFO];
    uint16_t sci_out_count;
    /* The background loop's use of time */
    void (*idle)(struct ht_regfile *rf);
    void *user;
} ht_regfile;

/** Reset state of a device; `map` is the device's ht_c2000_map. */
void ht_regfile_reset(ht_regfile *rf, const void *map);
/** The bytes of a model that was reset with the same `map`, in this process or another one, lie here now:
 *  its pointers into the tables are set anew. */
void ht_regfile_rebind(ht_regfile *rf, const void *map);

/* Accesses and instructions of a driver (ht_reg.h) */
uint16_t ht_regfile_read16(ht_regfile *rf, uint32_t addr);
void ht_regfile_write16(ht_regfile *rf, uint32_t addr, uint16_t value);
uint32_t ht_regfile_read32(ht_regfile *rf, uint32_t addr);
void ht_regfile_write32(ht_regfile *rf, uint32_t addr, uint32_t value);
void ht_regfile_eallow(ht_regfile *rf, uint16_t on);
void ht_regfile_settle(ht_regfile *rf);
void ht_regfile_nop(ht_regfile *rf);
/** A driver waits. With a gate on this is a violation: nobody watches the machine meanwhile. */
void ht_regfile_busy(ht_regfile *rf, uint16_t us);
void ht_regfile_vector(ht_regfile *rf, uint32_t addr, void (*isr)(void));
uint16_t ht_regfile_call(ht_regfile *rf, uint32_t addr, uint16_t argument);
void ht_regfile_intm(ht_regfile *rf, uint16_t masked);
void ht_regfile_ier(ht_regfile *rf, uint16_t mask);
void ht_regfile_ifr_clear(ht_regfile *rf);
void ht_regfile_idle(ht_regfile *rf);
/** The plant's absolute encoder; 0xFFFFFFFF: none. */
uint32_t ht_regfile_absolute(const ht_regfile *rf);

/* The hardware's side */

/** Time passes. */
void ht_regfile_wait(ht_regfile *rf, uint16_t us);
/** So many system clocks pass for eCAP1 and CPU timer 1. Returns 1 if INT13 is pending. */
uint16_t ht_regfile_pass(ht_regfile *rf, uint32_t clocks);
/** A conversion sequence ends: flag, interrupt. */
void ht_regfile_end_of_sequence(ht_regfile *rf);
/** ePWM1's counter passes 0. If PWM and ADC are set up for it, a sequence is converted.
 *  Returns 1 if it was. */
uint16_t ht_regfile_period(ht_regfile *rf);
/** CPU timer 0 reaches 0. Returns 1 if it runs. */
uint16_t ht_regfile_timer(ht_regfile *rf);
/** A pin goes to a level and stays there: 0 or 1. After reset all are high. While the trip
 *  pin is low, all modules that listen to it trip, and trip again if they are cleared. */
void ht_regfile_pin(ht_regfile *rf, uint16_t gpio, uint16_t level);
/** The levels of the pins have been changed in the words that hold them. */
void ht_regfile_pins(ht_regfile *rf);
/** The positive input of CMPSS `number`, 1 ... 8, is at this voltage for so long. Its high or low
 *  comparator trips the modules that listen once its filter has passed. */
void ht_regfile_analog(ht_regfile *rf, uint16_t number, float volts, uint16_t ns);
/** The clock fails (TZ5), a debugger halts the processor (TZ6): on the F28377S all modules
 *  that listen to it trip. On the F28335 these two are pins. */
void ht_regfile_clock_fails(ht_regfile *rf);
void ht_regfile_emulation_stops(ht_regfile *rf);
/** A byte arrives at the SCI's receiver. Returns 1 if it was taken. */
uint16_t ht_regfile_sci_arrive(ht_regfile *rf, uint16_t octet);
/** Next byte that leaves the transmitter, or 0xFFFF. */
uint16_t ht_regfile_sci_leave(ht_regfile *rf);

/* For tests */

/** The model's word for an address, without any protection; NULL if the model has no such word. */
uint16_t *ht_regfile_word(ht_regfile *rf, uint32_t addr);
/** Entry `n` of the table of registers (n < bound_count): address and value. */
uint32_t ht_regfile_address(const ht_regfile *rf, uint16_t n);
uint32_t ht_regfile_value(ht_regfile *rf, uint16_t n);
/** Name of the register at an address, "EPWM1.TBCTL", or "". */
void ht_regfile_name(const ht_regfile *rf, uint32_t addr, char name[HT_REGFILE_LINE]);
/** The name of a kind of violation. */
const char *ht_regfile_kind(uint16_t kind);

#endif
