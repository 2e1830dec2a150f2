/** @file ht_board_of_device.h
 *  Boards for those who know a chip by its number only: processor in the loop, replays.
 */
#ifndef HT_BOARD_OF_DEVICE_H
#define HT_BOARD_OF_DEVICE_H

#include "../c2000/ht_board.h"

/** The board that has a chip's own name, by the chip's number (`ht_device`). NULL: no such chip. */
const ht_board *ht_board_of_device(uint16_t device);

#endif
