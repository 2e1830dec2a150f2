/** @file ht_outputs.h
 *  Relay of the precharge, holding brake, fan and braking chopper, each by a pin of the board. The slow
 *  interrupt decides; a fault closes the brake in the fast interrupt that finds it. The chopper is the
 *  fast interrupt's: a slow period charges a link by tens of volts.
 *
 *  Precharge: a resistor charges the dc link until the relay bridges it. It does when the voltage is above
 *  a level and stands, and opens when the voltage has gone, or the next source would charge without it.
 *
 *  Brake: it opens when the torque is there, and the torque goes when it has closed:
 *    BUILDS -torque there-> OPENS -time-> OPEN -stop-> CLOSES -time-> CLOSED
 *  A load that hangs would fall meanwhile. Up to OPENS the torque is given, and while the brake moves the
 *  speed regulator holds standstill.
 */
#ifndef HT_OUTPUTS_H
#define HT_OUTPUTS_H

#include <stdbool.h>
#include <stdint.h>

typedef enum {
    HT_BRAKE_BUILDS,
    HT_BRAKE_OPENS,
    HT_BRAKE_OPEN,
    HT_BRAKE_CLOSES,
    HT_BRAKE_CLOSED
} ht_brake;

/** Times are slow interrupts. */
typedef struct {
    float precharge_V; /**< 0: there is no relay */
    float rearm_V;     /**< below it the relay opens */
    float stands; /**< the voltage must stand for so long, and the relay takes as long to close */
    float opens;  /**< time in which the brake opens; 0: there is none */
    float closes;
    float hold_Nm;      /**< torque before it opens */
    float fan_after;    /**< time for which the fan goes on; 0: there is none */
    float chopper_on_V; /**< out of reach if there is none */
    float chopper_off_V;
} ht_outputs_config;

typedef struct {
    uint16_t on;     /**< HT_OUT_... (port.h) without the chopper, as they were written last */
    uint16_t brake;  /**< ht_brake */
    float brake_for; /**< slow interrupts of its phase */
    float vdc_V;     /**< the voltage stands near this, ... */
    float stood;     /**< ... for so long */
    float fan_for;   /**< time that the fan has left */
} ht_outputs_state;

/** All off. */
void ht_outputs_reset(ht_outputs_state *st);

/** Slow interrupt: relay and fan, HT_OUT_... `works`: the drive works, or its winding is warm. */
uint16_t ht_outputs_step(const ht_outputs_config *cfg, ht_outputs_state *st, float vdc_V,
                         bool works);

/** Fast interrupt: is the chopper to be on that is `on` now? */
bool ht_outputs_chops(const ht_outputs_config *cfg, bool on, float vdc_V);

/** Is the dc link charged, and the relay closed? */
bool ht_outputs_charged(const ht_outputs_config *cfg, const ht_outputs_state *st);

/** Slow interrupt of a drive that controls torque: where the brake is. `follows`: the drive follows its
 *  references. */
ht_brake ht_outputs_brake(const ht_outputs_config *cfg, ht_outputs_state *st, float torque_Nm,
                          bool follows);

/** The shaft stands and is to be held: close the brake. True when it has closed. */
bool ht_outputs_close(const ht_outputs_config *cfg, ht_outputs_state *st);

/** The gates are off, so the brake is closed. */
void ht_outputs_drop(ht_outputs_state *st);

/** Is the brake told to be open? */
bool ht_outputs_lifted(const ht_outputs_config *cfg, const ht_outputs_state *st);

#endif
