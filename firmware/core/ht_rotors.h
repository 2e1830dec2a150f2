/** @file ht_rotors.h
 *  The functions of all kinds of rotor, for HT_ROTOR_DOES.
 */
#ifndef HT_ROTORS_H
#define HT_ROTORS_H

#include "ht_induction_rotor.h"
#include "ht_magnet_rotor.h"

#endif
