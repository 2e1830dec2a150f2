/** @file ht_vector_law.h
 *  The input of every law that decides on switching vectors (HT_VECTOR_LAW in ht_laws.def).
 */
#ifndef HT_VECTOR_LAW_H
#define HT_VECTOR_LAW_H

#include "ht_observer.h"

/** What the rotor of the machine induces. */
typedef struct {
    ht_xy v_pu;        /**< x-y voltage when the pattern takes effect, units of Vdc */
    float omega_rad_s; /**< electrical speed */
} ht_induced;

/** The values on which the law decides. */
typedef struct {
    const ht_estimate *decided; /**< flux and torque when the pattern takes effect */
    const ht_xy *psi_xy_Wb;     /**< x-y flux then; used if ht_<law>_law_needs_xy */
    ht_xy i_xy_A;               /**< x-y currents of the latest sample */
    float torque_ref_Nm;
    float flux_ref_Wb;
    const ht_induced *induced; /**< NULL: nothing */
    unsigned sector;           /**< of the flux decided on, 0..11 */
    uint16_t before;           /**< state word at the end of the running pattern */
    bool only_v0; /**< zero vectors: V0 only, else the one with the fewest transitions */
} ht_vector_law_input;

#endif
