/** @file ht_contracts.h
 *  The promises of the core's functions about their results, as conditions. `make prove` shows each
 *  of them for the function, and takes it for granted where it proves a caller apart from the
 *  function. No code of the drive reads this.
 */
#ifndef HT_CONTRACTS_H
#define HT_CONTRACTS_H

#include "ht_tables.h"

/** Magnitude at most `limit`; false for NaN. */
#define HT_IS_WITHIN(value, limit) (((value) <= (limit)) && ((value) >= -(limit)))
/** Both components. */
#define HT_IS_XY_WITHIN(v, limit) (HT_IS_WITHIN((v).x, limit) && HT_IS_WITHIN((v).y, limit))
/** A state word. */
#define HT_IS_WORD(word) ((word) < 64u)

/** ht_compare_two_level, ..._three_level, ..._five_level. `last` must be in the range, too. */
#define HT_IS_LEVEL(level, most) (((level) <= (most)) && ((level) >= -(most)))
/** ht_sector, ht_direction, ht_direction_along. */
#define HT_IS_SECTOR(sector) ((sector) < HT_DIRECTIONS)
/** ht_duty, ht_table_law_step. */
#define HT_ARE_ACTION_POINTS(p) ((0.0f <= (p).t1) && ((p).t1 <= (p).t2) && ((p).t2 <= 1.0f))
/** The limits that the laws give ht_xy_step: the deadbeat law's, and two of ht_tmvcl_pu. */
#define HT_IS_XY_LIMIT(limit) \
    (((limit) == 0.1f) || ((limit) == 0.0326920705f) || ((limit) == 0.0893163975f))
/** The bounds of ht_xy_step's integrators. */
#define HT_IS_XY_STATE(st, limit) \
    (HT_IS_XY_WITHIN((st).with, limit) && HT_IS_XY_WITHIN((st).against, limit))
/** The result of ht_applied_finish and ht_modulator_step, on which ht_volt_seconds relies. */
#define HT_IS_PATTERN(a)                                                       \
    (HT_IS_WORD((a).before) && HT_IS_WORD((a).s[0]) && HT_IS_WORD((a).s[1])    \
     && HT_IS_WORD((a).s[2]) && HT_IS_WORD((a).later) && HT_IS_WORD((a).close) \
     && HT_IS_WORD((a).rising) && HT_IS_WORD((a).falling) && ((a).own <= 2u))
/** The settings that ht_control_check accepts. */
#define HT_IS_PERIOD(p)                                                            \
    (((p).counts >= 8u) && ((p).first < ((p).counts / 2u)) && ((p).shortest >= 1u) \
     && ((p).shortest <= (((p).counts - (p).first) / 2u)))
/** A compare register that toggles its leg in the period, the shortest pulse away from both ends, or
 *  holds it. */
#define HT_IS_COMPARE(count, p)                                      \
    (((count) == (p).counts)                                         \
     || (((uint32_t)(count) >= ((uint32_t)(p).first + (p).shortest)) \
         && (((uint32_t)(count) + (p).shortest) <= (p).counts)))

#endif
