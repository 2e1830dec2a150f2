/** @file port.h
 *  The whole contract between the drive application and a target.
 *
 *  Who calls what, and when:
 *  - `ht_port_init` before interrupts are enabled, and again with all gates off when a
 *    parameter reaches into it. It leaves all gates off (one-shot trip latched) and
 *    the PWM counters running together; the slow interrupt's timer runs as well.
 *  - `ht_port_dead_range` and `ht_port_min_pulse_us` at any time, from anywhere: they touch no
 *    register.
 *  - `ht_port_begin_fast`, `ht_port_read`, `ht_port_write`, `ht_port_gates_off`, `ht_port_short_circuit`,
 *    `ht_port_gates_on`, `ht_port_leg_off`, `ht_port_tripped`, `ht_port_leg_tripped`,
 *    `ht_port_interrupt_lost`, `ht_port_beyond`, `ht_port_counts`, `ht_port_overrun`,
 *    `ht_port_ack_fast` from the fast interrupt only (`ht_port_read` from the set-up as well, and from the slow interrupt when no fast one comes any
 *    more). None blocks; each takes a fixed number of
 *    register accesses.
 *  - `ht_port_read_capture`, `ht_port_read_slow` and `ht_port_read_absolute` from the slow interrupt only, which
 *    the fast one may interrupt. The former clears the flags that it reports.
 *  - `ht_port_gates_off` also from anywhere else: it is two register writes
 *    per leg and is idempotent.
 *  - `ht_port_trip_levels` from the fast interrupt, and from the set-up with all gates off.
 *  - `ht_port_trip_pin_low` from anywhere: one register read.
 *  - `ht_port_outputs` from anywhere: one register write per output, none of which touches another pin.
 *
 *  Timing: counter = 0 of the PWM starts the conversion of all channels, one after the
 *  other; the end of the last one raises the fast interrupt, so that the results read
 *  in it are this period's. Under shadow load a pattern written in period n is on the legs in
 *  period n + 1; under immediate load from the write on.
 *
 *  `ht_port` is defined by each target; the caller owns it.
 */
#ifndef HT_PORT_H
#define HT_PORT_H

#include "ht_pattern.h"
#include "ht_speed_measure.h"

typedef struct ht_port ht_port;

/** Analog channels, in the order of the conversion sequence. */
enum { HT_ADC_I = 0 /* six phase currents, phase order */, HT_ADC_VDC = 6, HT_ADC_CHANNELS = 7 };

/** Range of a reading, counts, whatever the converter's resolution: full scale, and the reading of
 *  a current sensor without current. */
enum { HT_ADC_FULL = 4096, HT_ADC_MID = HT_ADC_FULL / 2 };

/** Slow analogue channels: thermistors. Each period converts one of them, or all. */
enum { HT_SLOW_WINDING = 0, HT_SLOW_SINK = 1, HT_SLOW_CHANNELS = 2 };

/** Raw readings of one sampling instant. */
typedef struct {
    uint16_t adc[HT_ADC_CHANNELS]; /**< right-justified counts, 0..HT_ADC_FULL - 1 */
    uint32_t position;             /**< quadrature counts since init, modulo 2^32 */
} ht_samples;

/** PWM and timer set-up. All counts are time-base counts. */
typedef struct {
    uint16_t period_counts; /**< TBPRD + 1, 8..65535 */
    uint16_t dead_counts;   /**< dead time, within `ht_port_dead_range` */
    bool shadow;            /**< load compare and action registers at counter = 0 */
    float slow_Hz;          /**< frequency of the slow interrupt */
} ht_pwm_setup;

/** Dead times that the board allows. Below `min_us` both switches of a leg may conduct at the same
 *  time; the register cannot hold more than `max_us`. */
typedef struct {
    float min_us;
    float max_us;
} ht_dead_range;

/** Dead times become whole counts by rounding up. As a float, 2.3 us is 229.99999 or 230.00001
 *  counts of 10 ns. A number that is less than this tolerance above a whole one counts as whole. */
#define HT_DEAD_TOLERANCE_COUNTS 0.01f

ht_dead_range ht_port_dead_range(const ht_port *port);

/** Shortest gate pulse that the board allows, us. A switch that is told to go off before it is fully on
 *  loses more energy, and its diode may snap off. */
float ht_port_min_pulse_us(const ht_port *port);

/** Can the hardware realise the set-up (period and dead time in range)? */
bool ht_port_accepts(const ht_port *port, const ht_pwm_setup *setup);

/** Configure PWM, trip zone, encoder interface and the slow interrupt's timer. Returns false,
 *  with the gates off, for a set-up that `ht_port_accepts` refuses. */
bool ht_port_init(ht_port *port, const ht_pwm_setup *setup);

/** PWM time-base clock, Hz. */
float ht_port_pwm_clock_Hz(const ht_port *port);

/** Latest conversion results and encoder position. */
void ht_port_read(ht_port *port, ht_samples *samples);

/** Reading, right-justified counts, of the slow channel that the call before has named as its `next`. From
 *  now on that one is converted. */
uint16_t ht_port_read_slow(ht_port *port, uint16_t channel, uint16_t next);

/** Clock of the capture timer, Hz: the unit of both times in `ht_capture`. */
float ht_port_capture_clock_Hz(const ht_port *port);

/** The capture unit's present values, and its events since the last call. */
void ht_port_read_capture(ht_port *port, ht_capture *capture);

/** No reading: there is no absolute encoder, or it has not answered. */
#define HT_NO_READING 0xFFFFFFFFu

/** Reading of an absolute encoder on the shaft, counts within a revolution, no older than a slow period.
 *  Waits for no answer. */
uint32_t ht_port_read_absolute(const ht_port *port);

/** Hand one period's pattern to the PWM. Harmless while the gates are off. */
void ht_port_write(ht_port *port, const ht_compare *pattern);

/** All gates off at once, latched until `ht_port_gates_on`. */
void ht_port_gates_off(ht_port *port);

/** The lower switches of all legs on and the upper ones off, latched until `ht_port_gates_off` or a reset:
 *  the trip zone forces them, so that no code, no pattern and no other trip changes it. The gates must have
 *  been off for longer than the dead time. */
void ht_port_short_circuit(ht_port *port);

/** Gates of one leg off, latched until `ht_port_gates_on` releases it. The others go on. */
void ht_port_leg_off(ht_port *port, uint16_t leg);

/** Release the latches of `legs`, a state word. Returns false, and leaves the latches as they are,
 *  while the trip pin is low. */
bool ht_port_gates_on(ht_port *port, uint16_t legs);

/** True while the latch of any of `legs`, a state word, is set, whoever set it (software or the
 *  trip pin). */
bool ht_port_tripped(const ht_port *port, uint16_t legs);

/** The same for one leg. The pin trips all legs together, and so does `ht_port_gates_off`: any leg
 *  shows these. A disturbance may set the latch of one leg alone: therefore each is checked in turn.
 */
bool ht_port_leg_tripped(const ht_port *port, uint16_t leg);

/** Has the target itself taken the gates off since `ht_port_gates_on`, because no fast interrupt came
 *  for 2.5 periods? */
bool ht_port_interrupt_lost(const ht_port *port);

/** Over-current levels of the six phases and over-voltage level of the dc link, readings of the ADC. */
typedef struct {
    uint16_t low[HT_ADC_CHANNELS];  /**< 0: out of reach; the dc link has none */
    uint16_t high[HT_ADC_CHANNELS]; /**< from HT_ADC_FULL on it may be out of reach */
} ht_trip_levels;

/** From now on a channel whose reading would stay below `low` or above `high` takes all gates off by
 *  hardware, where the target has a comparator for it. Never at less than these levels. Takes a fixed
 *  number of register accesses. */
void ht_port_trip_levels(ht_port *port, const ht_trip_levels *levels);

/** Channels whose comparators have taken the gates off since `ht_port_gates_on`: bit n is channel n. */
uint16_t ht_port_beyond(const ht_port *port);

/** Is the trip pin low now? While it is, the gates must stay off. */
bool ht_port_trip_pin_low(const ht_port *port);

/** Outputs, bits: a pin that is high. After a reset and without a right clock all are inputs, which the
 *  board pulls down: relay open, brake closed, fan and chopper off. */
enum {
    HT_OUT_PRECHARGE = 1,
    HT_OUT_BRAKE = 2,
    HT_OUT_FAN = 4,
    HT_OUT_CHOPPER = 8,
    HT_OUTPUTS = 4 /**< how many */
};

/** Of the outputs `which` those in `on` on and the rest off; the others stay. */
void ht_port_outputs(ht_port *port, uint16_t which, uint16_t on);

/** First in the fast interrupt: acknowledge the end of conversion, so that the next one shows. If the
 *  next call does not come within 2.5 periods, the target takes the gates off. */
void ht_port_begin_fast(ht_port *port);

/** Has another conversion ended since `ht_port_begin_fast`? Asked at the end of the interrupt: if
 *  so, the interrupt took longer than its period. */
bool ht_port_overrun(const ht_port *port);

/** Counts of the PWM's clock since its period began; the conversion started then. */
uint16_t ht_port_counts(const ht_port *port);

/** At the end of the drive's part of the fast interrupt: acknowledge it at the interrupt controller. The
 *  CPU takes the next one when the whole interrupt has ended. */
void ht_port_ack_fast(ht_port *port);

#endif
