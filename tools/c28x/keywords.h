/* TI's keywords for checks with other compilers. Nothing is linked or run. */
#ifndef HT_C28X_KEYWORDS_H
#define HT_C28X_KEYWORDS_H

#define __interrupt
#define __cregister
#define __asm(text) ((void)0)

#endif
