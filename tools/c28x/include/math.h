/* The only functions of the C library that the firmware calls, for compilers that come
 * without a library for the target. */
#ifndef HT_C28X_MATH_H
#define HT_C28X_MATH_H

float sqrtf(float x);
float fabsf(float x);

#endif
