/** @file ht_initial.h
 *  Initial values of the parameters: those of the table, or of a set-up. The build option HT_SETUP
 *  (docs/flash.md) writes HT_INITIAL_VALUES, a header that defines HT_INITIAL_<name> for all of
 *  them (cmake/initial_values.py).
 */
#ifndef HT_INITIAL_H
#define HT_INITIAL_H

#ifdef HT_INITIAL_VALUES
#include HT_INITIAL_VALUES
#define HT_DEF(name, of_table) HT_INITIAL_##name
#else
#define HT_DEF(name, of_table) (of_table)
#endif

#endif
