#include "ht_pil.h"

#include "ht_board_of_device.h"

#include <stddef.h>

uint16_t ht_side_registers(void)
{
    uint32_t address[HT_MIRROR_MAX];
    return ht_mirror_addresses(&ht_f28335, address);
}

bool ht_side_init(ht_pil_side *side, ht_port *port, uint16_t device, ht_reader *request)
{
    const ht_board *board = ht_board_of_device(device);
    if ((board == NULL) || !ht_reader_done(request)) {
        return false;
    }
    ht_port_bind(port, &side->registers, board);
    ht_regfile_reset(&side->registers, port->map);
    ht_mirror_init(&side->mirror, &side->registers, port->map);
    return ht_board_start(port);
}

bool ht_side_take(ht_pil_side *side, ht_port *port, ht_reader *request)
{
    bool taken = ht_mirror_take(&side->mirror, request);
    (void)port;
    ht_regfile_pins(&side->registers);
    return taken;
}

void ht_side_tell(ht_pil_side *side, ht_port *port, uint16_t number, ht_packet *reply)
{
    (void)port;
    ht_packet_add32(reply, side->registers.accesses);
    ht_packet_add32(reply, side->registers.violations);
    ht_packet_add32(reply, ht_mirror_digest(&side->mirror, number));
    ht_mirror_tell(&side->mirror, reply);
}
