/** @file ht_rotor_rules.h
 *  The rules for all kinds of rotor, for HT_ROTOR_DOES.
 */
#ifndef HT_ROTOR_RULES_H
#define HT_ROTOR_RULES_H

#include "ht_induction_rules.h"
#include "ht_magnet_rules.h"

#endif
