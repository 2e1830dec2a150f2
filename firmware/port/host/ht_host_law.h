/** @file ht_host_law.h
 *  A law outside the firmware: a function of the host decides on the pattern, and everything else
 *  is the drive's own. Sampling, protection, states, observer, prediction, references, registers
 *  and latency are those of every scheme, so what is compared is the law.
 *
 *  In RUN the fast interrupt goes its way under a scheme of the firmware. Then the function sees
 *  what that scheme saw, and its pattern takes the place of the scheme's: in the registers, before
 *  they load, and in what the drive knows of the period to come. It needs shadow load and
 *  prediction.
 *
 *  What the function returns is checked before anything is written. If it cannot be a pattern, the
 *  gates go off as for an external trip, and `wrong` says what it was.
 */
#ifndef HT_HOST_LAW_H
#define HT_HOST_LAW_H

#include "ht_drive.h"

/** The input of a law. Where nothing else is said, a quantity is that of the instant at which the
 *  pattern begins, one period after the sample: predicted. */
typedef struct {
    ht_ab i_A;      /**< stator current */
    ht_xy i_xy_A;   /**< the same in x-y */
    ht_ab psi_Wb;   /**< stator flux */
    ht_ab rotor_Wb; /**< rotor flux seen from the stator, psi - sigma L_s i */
    ht_ab sampled_i_A;
    ht_xy sampled_i_xy_A;
    ht_ab sampled_psi_Wb;    /**< estimated at the sample */
    float phases_A[HT_LEGS]; /**< sampled */
    float torque_Nm;
    float torque_ref_Nm;
    float flux_ref_Wb;
    float vdc_V;          /**< sampled */
    float omega_rad_s;    /**< electrical speed of the flux, low pass */
    float rotor_turn_rad; /**< electrical angle that the rotor turned in the latest period */
    float speed_rad_s;    /**< of the shaft, mechanical, as the speed loop sees it */
    float rs_ohm;         /**< resistances in use */
    float rr_ohm;
    float ts_s; /**< constants of the drive, from its parameters */
    float sigma_ls_H;
    float lxy_H;
    float lm_H;
    float lr_H;
    float pole_pairs;
    float torque_limit_Nm;
    uint32_t before; /**< state word at the end of the period before */
    uint32_t period; /**< number of the call, from 0 at each start */
} ht_host_law_seen;

/** The result of a law. */
typedef enum {
    HT_RETURNS_DUTIES = 0, /**< six duty ratios, 0..1: each leg toggles once, every second period
                            *   rises, every other one falls; the dead time is compensated */
    HT_RETURNS_VECTORS = 1 /**< three state words and two instants, 0 <= t1 <= t2 <= 1 */
} ht_host_law_kind;

#define HT_HOST_LAW_VALUES 6

/** Decides on a pattern: writes the values and returns how many there are, or -1 if it failed.
 *  `memory` is the law's own. */
typedef int32_t (*ht_host_law_step)(const void *seen, void *memory, float *values);

/** Why a law was stopped. */
typedef enum {
    HT_HOST_LAW_RIGHT = 0,
    HT_HOST_LAW_FAILED = 1, /**< the function failed */
    HT_HOST_LAW_SHAPE = 2,  /**< a wrong number of values */
    HT_HOST_LAW_VALUE = 3,  /**< a value out of its range, or not finite */
    HT_HOST_LAW_ORDER = 4   /**< t1 > t2 */
} ht_host_law_error;

/** A drive under a law of the host. */
typedef struct {
    ht_drive *drive;
    ht_host_law_step step;
    void *memory;        /**< the caller's, `size` bytes; NULL: none */
    const void *initial; /**< what it holds at each start */
    uint32_t size;
    uint16_t kind;                   /**< ht_host_law_kind */
    uint16_t running;                /**< 1 from the first step after a start on */
    uint16_t falling;                /**< duty ratios: legs start high in the next period */
    uint16_t wrong;                  /**< ht_host_law_error of the latest stop */
    int32_t count;                   /**< values it returned then */
    uint32_t index;                  /**< which of them was wrong */
    uint32_t tick;                   /**< fast interrupt in which that was */
    float value[HT_HOST_LAW_VALUES]; /**< latest */
    ht_host_law_seen seen;           /**< latest */
} ht_host_law;

/** Entry points in place of the drive's own. */
void ht_host_law_fast(ht_host_law *h);
void ht_host_law_slow(ht_host_law *h);
void ht_host_law_channels(const ht_host_law *h, float *out);

#endif
