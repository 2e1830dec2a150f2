/** @file ht_result.h
 *  The answer to a command.
 */
#ifndef HT_RESULT_H
#define HT_RESULT_H

/** Result of a command or an initialisation (ht_results.def). */
typedef enum {
    HT_OK = 0,
#define HT_RESULT(name, number, mistake, text) HT_ERROR_##name = (number),
#define HT_REFUSAL(name, number, mistake, text)
#include "ht_results.def"
#undef HT_RESULT
#undef HT_REFUSAL
} ht_result;

#endif
