/** @file ht_schemes.h
 *  The control schemes: numbers, and what the table ht_schemes.def says of each.
 */
#ifndef HT_SCHEMES_H
#define HT_SCHEMES_H

#include "ht_types.h"

/** HT_<id> of every row, in table order; HT_SCHEMES is their number. */
typedef enum {
#define HT_SCHEME(id, name, law, vectors, group, regulated, levels, reach) HT_##id,
#include "ht_schemes.def"
#undef HT_SCHEME
    HT_SCHEMES
} ht_scheme;

/** HT_LAW_<id> of every row of ht_laws.def; HT_LAWS is their number. Several schemes may share a
 *  law. */
typedef enum {
#define HT_VECTOR_LAW(id, law) HT_LAW_##id,
#define HT_VOLTAGE_LAW HT_VECTOR_LAW
#define HT_PATTERN_LAW HT_VECTOR_LAW
#include "ht_laws.def"
#undef HT_VECTOR_LAW
#undef HT_VOLTAGE_LAW
#undef HT_PATTERN_LAW
    HT_LAWS
} ht_law;

/** The ways to make the active vectors of a period. */
typedef enum {
    HT_VECTORS_SINGLE = 0,     /**< one vector of the group */
    HT_VECTORS_PAIR = 1,       /**< one of the group or medium-large, whichever lowers psi_xy */
    HT_VECTORS_PAIR_SMALL = 2, /**< the same, with small vectors at the lower torque levels */
    HT_VECTORS_VIRTUAL = 3,    /**< three consecutive vectors of the group */
    HT_VECTORS_MODULATED = 4,  /**< no table: those that a modulator makes of a voltage */
    HT_VECTORS_CENTRED = 5,    /**< the same: zero sequences centred, carriers in phase */
    HT_VECTORS_TURNED = 6,     /**< the same: set 2's carrier turned in every second sector */
    HT_VECTORS_INTERLEAVED = 7 /**< the same: carriers a quarter of their period apart */
} ht_vectors;

typedef struct {
    ht_law law;
    ht_vectors vectors;
    uint16_t group;         /**< HT_L, HT_ML or HT_S */
    bool regulated;         /**< an x-y regulator sets the duty ratios */
    uint16_t torque_levels; /**< 2, 3 or 5; 0 without a comparator */
    float reach_pu;         /**< largest circle of mean voltage, units of Vdc */
} ht_scheme_info;

/** Row of a scheme, or NULL if there is no such number. */
const ht_scheme_info *ht_scheme_describe(uint16_t scheme);

/** True if a law commands a voltage (ht_voltage_law.h), or a pattern from what that sees. It needs shadow load
 *  and prediction. */
bool ht_law_commands_voltage(ht_law law);

/** True if the scheme regulates the x-y currents to zero. */
bool ht_scheme_regulates_xy(const ht_scheme_info *row);

/** Limit of the x-y voltage command per axis, units of Vdc: the TMVCL of the group whose duty
 *  ratios the scheme's regulator sets; 0 for a scheme without a regulator. */
float ht_scheme_xy_limit_pu(const ht_scheme_info *row);

/** True if the scheme can drive a machine with this winding. Where the sets are 0 or 60 degrees apart,
 *  the large vectors have no x-y voltage. So no choice or mixture of them can set one, and set 2's
 *  carrier may not turn. */
bool ht_scheme_drives(const ht_scheme_info *row, ht_winding winding);

/** Length of the longest voltage vector, units of Vdc: (2/3) cos 15 degrees, or 2/3. */
float ht_longest_pu(ht_winding winding);

/** Largest circle of mean voltage where both sets make the same: (2/3) cos 30 degrees. */
#define HT_REACH_ALIKE_PU 0.577350f

/** Largest change of the x-y flux by the vectors of one period, units of Vdc Ts. Of several in a
 *  period the mean is zero, and in between they reach a third. A command that is beyond what the
 *  modulator can make loses this mean. There is none where both sets make the same voltage. */
float ht_scheme_xy_step_pu(const ht_scheme_info *row, ht_winding winding);

/** Largest x-y flux of the ripple of interleaved carriers, at any voltage, units of Vdc Ts; 0 for
 *  another scheme. For a carrier in which the sets join or part it is up to 0.29: less than the third
 *  that a torque step adds. */
float ht_scheme_xy_ripple_pu(const ht_scheme_info *row);

#endif
