/** @file ht_pil_snapshot.h
 *  The fault snapshot (`ht_snapshot`) as words of a reply, and back.
 */
#ifndef HT_PIL_SNAPSHOT_H
#define HT_PIL_SNAPSHOT_H

#include "ht_drive.h"
#include "ht_frame.h"

/** Tick (32 bits), state, faults, ADC counts, position (32 bits); floats: currents, Vdc,
 *  torque and flux reference, flux alpha and beta, torque, speed. */
enum { HT_PIL_SNAPSHOT_WORDS = 4 + HT_ADC_CHANNELS + 2 + 2 * (HT_LEGS + 7) };

/** Append it to a reply. */
void ht_pil_snapshot_add(ht_frame *reply, const ht_snapshot *s);
/** Take HT_PIL_SNAPSHOT_WORDS words; what does not travel becomes 0. */
void ht_pil_snapshot_take(const uint16_t *words, ht_snapshot *s);

#endif
