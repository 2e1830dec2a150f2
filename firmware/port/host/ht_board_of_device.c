#include "ht_board_of_device.h"

#include <stddef.h>

const ht_board *ht_board_of_device(uint16_t device)
{
    static const ht_board *const boards[HT_DEVICES] = {
#define HT_CHIP(name, family) &ht_board_##name,
#define HT_CHIP_BOARD(chip, name)
#include "../c2000/ht_chips.def"
#undef HT_CHIP
#undef HT_CHIP_BOARD
    };
    return (device < (uint16_t)HT_DEVICES) ? boards[device] : NULL;
}
