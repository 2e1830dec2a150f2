/** @file ht_rotor.h
 *  The kinds of rotor. A kind has its number and its row here, its functions for the control step
 *  (ht_<kind>_rotor.h, which ht_rotors.h includes) and for the drive (ht_<kind>_rules.h, ht_drive_slow.h).
 *  What only some kinds have is a property that is asked for: `has_axis`, `induces`, `salient`.
 *
 *  The numbers are those of the parameter `machine`.
 */
#ifndef HT_ROTOR_H
#define HT_ROTOR_H

typedef enum {
    HT_ROTOR_INDUCTION, /**< a winding or a cage, in which the stator induces */
    HT_ROTOR_MAGNET,    /**< permanent magnets */
    HT_ROTORS
} ht_rotor;

/** The kind that has a copy of the control step of its own. */
#define HT_ROTOR_PLAIN HT_ROTOR_INDUCTION

/** Calls the kind's function `does` with the arguments `given`, which are in brackets. No pointers: the
 *  stack can be analysed, and a known kind costs no instruction. A row for each kind, the last one
 *  without a question. */
/* clang-format off */
#define HT_ROTOR_DOES(rotor, does, given) (                  \
    ((rotor) == HT_ROTOR_MAGNET) ? ht_magnet_##does given :  \
    ht_induction_##does given)
/* clang-format on */

#endif
