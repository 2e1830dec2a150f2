/* All that the firmware uses of the C library's <math.h>, for compilers that come without a library
 * for the target. */
#ifndef HT_C28X_MATH_H
#define HT_C28X_MATH_H

#define NAN __builtin_nanf("")

float sqrtf(float x);
float fabsf(float x);

#endif
