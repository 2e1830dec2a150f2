#include "ht_pil.h"

uint16_t ht_side_registers(void)
{
    uint32_t address[HT_MIRROR_MAX];
    return ht_mirror_addresses(&ht_f28335, address);
}

bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, const uint16_t *words,
                  uint16_t n)
{
    (void)words;
    if ((device > 1u) || (n != 0u)) {
        return false;
    }
    ht_port_bind(port, &side->registers, (device == 0u) ? &ht_board_f28335 : &ht_board_f28377s);
    ht_regfile_reset(&side->registers, port->map);
    ht_mirror_init(&side->mirror, &side->registers, port->map);
    return ht_board_start(port);
}

bool ht_side_take(ht_pil_side *side, ht_port *port, const uint16_t *words, uint16_t n)
{
    bool taken = ht_mirror_apply(&side->mirror, words, n);
    (void)port;
    ht_regfile_pins(&side->registers);
    return taken;
}

void ht_side_status(ht_pil_side *side, const ht_port *port, ht_frame *reply)
{
    (void)port;
    ht_frame_add32(reply, side->registers.accesses);
    ht_frame_add32(reply, side->registers.violations);
    /* As both sides should have it once the changes, which follow, are taken over. */
    ht_frame_add32(reply, ht_mirror_digest(&side->mirror, ht_frame_number(reply)));
}

void ht_side_tell(ht_pil_side *side, ht_port *port, ht_frame *reply)
{
    uint16_t pairs[2 * HT_MIRROR_MAX];
    uint16_t n = ht_mirror_changes(&side->mirror, pairs);
    uint16_t i;
    (void)port;
    for (i = 0u; i < n; i++) {
        ht_frame_add(reply, pairs[i]);
    }
}
