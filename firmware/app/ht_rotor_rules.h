/** @file ht_rotor_rules.h
 *  The functions of all kinds of rotor, for HT_ROTOR_DOES in the drive.
 */
#ifndef HT_ROTOR_RULES_H
#define HT_ROTOR_RULES_H

#include "ht_induction_rules.h"
#include "ht_magnet_rules.h"
#include "ht_rotors.h"

#endif
