/** @file ht_ntc.h
 *  A thermistor (NTC) from an analogue input to ground, with a resistor from the converter's reference to
 *  the input. Its resistance falls with the temperature by the beta equation:
 *
 *    1/T = 1/T_25 + ln(R/R_25)/beta,   R = R_pull counts/(full - counts)
 *
 *  So the temperature falls as the reading rises, for any parameters. The slow interrupt reads it. A reading
 *  next to an end of the range is an open or a shorted sensor.
 */
#ifndef HT_NTC_H
#define HT_NTC_H

#include <stdbool.h>
#include <stdint.h>

/** Nearer to an end of the range than this a reading tells no temperature: converters are wrong by up to
 *  15 counts of offset. And temperatures that a reading must tell at least. */
enum { HT_NTC_END_COUNTS = 24, HT_NTC_COLD_DEGC = -20, HT_NTC_HOT_DEGC = 155 };

typedef struct {
    float pull_share; /**< pull-up resistor over R_25; 0: there is no sensor */
    float per_K;      /**< 1/beta */
    float gain;       /**< low pass of the readings */
    float patience;   /**< so many readings in a row that tell nothing are a fault */
} ht_ntc_config;

typedef struct {
    float counts; /**< low pass of the readings that tell something; 0: there was none yet */
    float missed; /**< readings in a row that tell nothing */
    float degC;
} ht_ntc_state;

typedef enum { HT_NTC_WHOLE, HT_NTC_OPEN, HT_NTC_SHORT } ht_ntc;

/** Nothing is known. */
void ht_ntc_reset(ht_ntc_state *st);

/** `beta_K`: from 25 degC on; `readings_Hz`: how often there is one. */
void ht_ntc_configure(ht_ntc_config *c, float ohm, float beta_K, float pull_up_ohm,
                      float readings_Hz);

/** Temperature of a reading between the ends. */
float ht_ntc_degC(const ht_ntc_config *cfg, float counts);

/** Do readings tell all temperatures up to this one? */
bool ht_ntc_reaches(const ht_ntc_config *cfg, float hot_degC);

/** Take a reading. */
ht_ntc ht_ntc_take(const ht_ntc_config *cfg, ht_ntc_state *st, uint16_t reading);

/** Is there a sensor, and has it told its temperature? */
bool ht_ntc_tells(const ht_ntc_config *cfg, const ht_ntc_state *st);

#endif
