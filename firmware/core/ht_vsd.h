/** @file ht_vsd.h
 *  Vector space decomposition of six phase quantities.
 */
#ifndef HT_VSD_H
#define HT_VSD_H

#include "ht_types.h"

/** VSD transform of six phase quantities, with sets that are 30 degrees apart. */
ht_vsd ht_vsd_from_six(const ht_six *s);

/** Set 2 turned from 30 degrees to where it lies in another winding. With the sets' vectors s1 and s2
 *  in the stator's axes, alpha + j beta = (s1 + s2)/2 and x - j y = (s1 - s2)/2 in each of them. */
ht_vsd ht_vsd_turned(ht_winding winding, ht_vsd v);

/** And back. */
ht_vsd ht_vsd_turned_back(ht_winding winding, ht_vsd v);

#endif
