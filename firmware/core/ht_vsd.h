/** @file ht_vsd.h
 *  Vector space decomposition of six phase quantities.
 */
#ifndef HT_VSD_H
#define HT_VSD_H

#include "ht_types.h"

/** VSD transform of six phase quantities. */
ht_vsd ht_vsd_from_six(const ht_six *s);

#endif
