/** @file ht_burst_rows.h
 *  The firmware's own capture, fed with telemetry that a simulation has recorded.
 */
#ifndef HT_BURST_ROWS_H
#define HT_BURST_ROWS_H

#include "ht_burst.h"

/** Take `n` rows of `width` channels, one for each fast interrupt, as samples of the capture.
 *  The first row belongs to `tick`; column `fault` is not zero while a fault is latched. */
void ht_burst_rows(ht_burst *b, const float *rows, uint32_t n, uint16_t width, uint32_t tick,
                   uint16_t fault);

#endif
