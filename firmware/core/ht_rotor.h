/** @file ht_rotor.h
 *  The kinds of rotor. A kind has a header with its functions for the control step (ht_<kind>_rotor.h),
 *  its row in each of the two lists here, and its functions for the drive (app/ht_drive_<kind>.c). Nothing
 *  else in the firmware names a kind.
 *
 *  The numbers are those of the parameter `machine`.
 */
#ifndef HT_ROTOR_H
#define HT_ROTOR_H

typedef enum {
    HT_ROTOR_INDUCTION = 0, /**< a winding or a cage, in which the stator induces */
    HT_ROTOR_MAGNET = 1     /**< permanent magnets */
} ht_rotor;

/** The kind that has a copy of the control step of its own. */
#define HT_ROTOR_PLAIN HT_ROTOR_INDUCTION

/** Calls the kind's function `does` with the arguments `given`, which are in brackets. No pointers: the
 *  stack can be analysed, and a known kind costs no instruction. */
#define HT_ROTOR_DOES(rotor, does, given) \
    (((rotor) == HT_ROTOR_MAGNET) ? ht_magnet_##does given : ht_induction_##does given)

#endif
