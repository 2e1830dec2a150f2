/** @file ht_short_circuit.h
 *  The trip state of a machine with magnets that turns above its ceiling: there the magnets induce more
 *  than the dc link's voltage, and with the gates off the diodes rectify. The lower switches of all
 *  six legs are on instead, and the machine's own inductance limits the current.
 *
 *  The gates are off for a whole period first, which is longer than any dead time. An over-current and
 *  the trip pin end the short circuit, until the shaft has been below the ceiling. It also ends when
 *  the shaft is slow enough by the encoder, and by the frequency of the current, which needs no
 *  encoder.
 */
#ifndef HT_SHORT_CIRCUIT_H
#define HT_SHORT_CIRCUIT_H

#include "ht_params.h"
#include "ht_types.h"

typedef struct {
    bool allowed;
    float
        rad_s_per_V; /**< electrical speed at which the magnets induce 1 V between two terminals */
    float vdc_min_V; /**< the link's voltage counts within these two */
    float vdc_max_V;
    float most_A2; /**< current in alpha-beta that the magnets bear, squared */
    float ts_s;
    float gain;    /**< of the means of the current's steps, per fast interrupt */
    float decay;   /**< of `fast_rad_s`, per slow interrupt */
    uint32_t hold; /**< fast interrupts until the end is judged */
} ht_short_circuit_config;

typedef struct {
    uint16_t on;     /**< 1: the lower switches are on */
    uint16_t off;    /**< 1: the gates have been off for a period */
    uint16_t barred; /**< 1: an over-current or the trip pin, since the shaft was fast */
    uint32_t ticks;  /**< fast interrupts since it went on */
    float
        fast_rad_s; /**< size of the electrical speed; falls slowly: an encoder may have stopped */
    ht_ab i_A;
    ht_ab step_A;    /**< of the current in the last period */
    float cross_A2;  /**< means of two successive steps' product across each other, */
    float square_A2; /**< and of a step's square */
} ht_short_circuit_state;

typedef struct {
    ht_ab i_A;
    float vdc_V;
    float omega_rad_s;     /**< electrical speed by the encoder */
    bool encoder_doubtful; /**< the encoder has tripped the drive */
    bool forbidden;        /**< over-current or the trip pin has, or the pin is low */
} ht_short_circuit_input;

void ht_short_circuit_configure(const ht_params *p, ht_short_circuit_config *c);

/** Electrical speed at which the magnets induce the link's voltage. */
float ht_short_circuit_ceiling_rad_s(const ht_short_circuit_config *cfg, float vdc_V);
/** Share of it up to which the gates may be off, or go on. */
#define HT_CLEAR_OF_CEILING 0.9f

void ht_short_circuit_reset(ht_short_circuit_state *st);

/** In each slow interrupt, in every state. */
void ht_short_circuit_follow(const ht_short_circuit_config *cfg, ht_short_circuit_state *st,
                             float omega_rad_s);

/** A fast interrupt in which nothing controls. Returns whether the lower switches are to be on; else the
 *  gates are to be off. */
bool ht_short_circuit_step(const ht_short_circuit_config *cfg, ht_short_circuit_state *st,
                           const ht_short_circuit_input *in);

/** The current is beyond what the magnets bear. */
bool ht_short_circuit_beyond(const ht_short_circuit_config *cfg, ht_ab i_A);

/** The gates are on, or go on. */
void ht_short_circuit_ends(ht_short_circuit_state *st);

#endif
