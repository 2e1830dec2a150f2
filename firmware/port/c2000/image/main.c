/* Entry of the image, after the runtime's own start. This file stays in the flash; the
 * linker gives everything else that is called from here a place in RAM, and main
 * copies it there first: 0 wait states, and the flash may be set up. The symbols come
 * from the linker command files; a ..._size is in the symbol's address. */
#include "ht_image.h"

extern const uint16_t ht_code_load[];
extern uint16_t ht_code_run[];
extern const uint16_t ht_code_size[];
extern const uint16_t ht_const_load[];
extern uint16_t ht_const_run[];
extern const uint16_t ht_const_size[];

static void copy(uint16_t *to, const uint16_t *from, uint32_t words)
{
    uint32_t n;
    for (n = 0u; n < words; n++) {
        to[n] = from[n];
    }
}

int main(void)
{
    copy(ht_code_run, ht_code_load, (uint32_t)(uintptr_t)ht_code_size);
    copy(ht_const_run, ht_const_load, (uint32_t)(uintptr_t)ht_const_size);
    ht_image_start();
    for (;;) {
        ht_image_background();
        HT_IDLE(HT_TARGET_IO);
    }
}
