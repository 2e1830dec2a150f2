/* As math.h: what processor in the loop calls of the C library besides. */
#ifndef HT_C28X_STRING_H
#define HT_C28X_STRING_H

void *memset(void *at, int value, unsigned size);

#endif
