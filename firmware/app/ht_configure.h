/** @file ht_configure.h
 *  Derives the values that the interrupts use from the parameters.
 */
#ifndef HT_CONFIGURE_H
#define HT_CONFIGURE_H

#include "ht_drive.h"

/** True if `value` is finite, in `ht_param_range` and, for choices, whole. */
bool ht_configure_valid(const ht_port *port, uint16_t id, float value);

/** Control configuration and PWM set-up of `c->params`, which are each in range. Refuses
 *  those that do not fit together (HT_ERROR_CONFIG) or the hardware (HT_ERROR_PORT).
 *  `c->control` is then half-written. */
ht_result ht_configure(const ht_port *port, ht_drive_config *c, ht_pwm_setup *setup);

/** The values outside the control configuration that follow from `c->params` and may change while
 *  the drive runs: speed loop, flux reference, protection. */
void ht_configure_rest(const ht_port *port, ht_drive_config *c);

/** The configuration in force. The pointer is read once, because the fast interrupt may exchange
 *  the configuration at any time. */
static inline const ht_drive_config *ht_config_in_force(const ht_drive *d)
{
    const ht_drive_config *const volatile *config = &d->config;
    return *config;
}

/** Where the next configuration is written, in `*next`: the copy that is not in force. The
 *  interrupt takes nothing over until `staged` is set again. Returns what was staged and not
 *  taken yet, or NULL. */
const ht_drive_config *ht_configure_withhold(ht_drive *d, ht_drive_config **next);

/** After a refusal: if the parameters that were accepted before were still `waiting` in `next`,
 *  they are put there again and staged. */
void ht_configure_restore(ht_drive *d, const ht_drive_config *waiting, ht_drive_config *next);

/** Scaling and times, which only change with the gates off. */
void ht_configure_scales(ht_drive *d);

/** New parameters, `next->params`, for a drive that may be running: checked, then handed to the
 *  next fast interrupt. After an error the caller restores. */
ht_result ht_configure_live(ht_drive *d, ht_drive_config *next);

#endif
