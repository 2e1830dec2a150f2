/** @file ht_types.h
 *  Reference frames and shared small types of the control core.
 *
 *  Phase order everywhere: u1 u2 w1 w2 v1 v2 at 0, 30, 120, 150, 240, 270
 *  electrical degrees. A state word holds one upper-switch bit per leg, u1 in
 *  bit 5 (most significant) down to v2 in bit 0. The transform is amplitude
 *  invariant, so power = 3 * (sum over alpha-beta and x-y).
 *
 *  Portability: `char` and `int` have 16 bits on C28x. Use uint16_t for state
 *  words and counts, `unsigned` (at most 16 bits of value) for indices, float
 *  for quantities; nothing narrower, nothing wider in the fast path.
 */
#ifndef HT_TYPES_H
#define HT_TYPES_H

#include <stdbool.h>
#include <stdint.h>

#define HT_LEGS 6

/** The place of a function's code: one that seldom runs, small and not into its caller; not into its caller;
 *  into each of its callers; with copies of all that it calls. HT_SMALL: an image whose size counts and
 *  whose time does not has one of each. */
#if defined(__GNUC__) && !defined(HT_SMALL)
#define HT_SELDOM __attribute__((cold, noinline))
#define HT_APART __attribute__((noinline))
#define HT_INTO_CALLERS inline __attribute__((always_inline))
#define HT_WITH_CALLED __attribute__((flatten))
#else
#define HT_SELDOM
#define HT_APART
#define HT_INTO_CALLERS
#define HT_WITH_CALLED
#endif

/** State words: all legs, leg 0, legs of a set. */
#define HT_ALL_LEGS 0x3Fu
#define HT_LEG_U1 0x20u
#define HT_SET1 0x2Au
#define HT_SET2 0x15u

/** Stationary torque-producing plane. */
typedef struct {
    float alpha;
    float beta;
} ht_ab;

/** Stationary secondary (loss-producing) plane. */
typedef struct {
    float x;
    float y;
} ht_xy;

/** Vector space decomposition of one six-phase quantity. There are no zero sequences: the two
 *  neutrals are isolated. */
typedef struct {
    ht_ab ab;
    ht_xy xy;
} ht_vsd;

/** One value per phase, in phase order. */
typedef struct {
    float p[HT_LEGS];
} ht_six;

/** The angle of set 2 ahead of set 1: values of the parameter `displacement_deg`. */
typedef enum { HT_WINDING_30 = 0, HT_WINDING_0 = 1, HT_WINDING_60 = 2 } ht_winding;

#define HT_WINDINGS 3u

#endif
