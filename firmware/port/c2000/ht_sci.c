/* SCI-A, the same registers on both devices. */
#include "ht_drivers.h"

/* Words from the module's first register */
#define SCICCR 0x00u
#define SCICTL1 0x01u
#define SCIHBAUD 0x02u
#define SCILBAUD 0x03u
#define SCICTL2 0x04u
#define SCIRXST 0x05u
#define SCIRXBUF 0x07u
#define SCITXBUF 0x09u
#define SCIFFTX 0x0Au
#define SCIFFRX 0x0Bu
#define SCIFFCT 0x0Cu
#define SCICCR_8N1 0x0007u
#define SCICTL1_RUN 0x0023u /* receiver, transmitter, out of software reset */
#define SCICTL1_RESET 0x0003u
#define SCIRXST_ERROR 0x0080u
#define SCIFFTX_FIFOS 0xC000u /* channels and FIFOs enabled */
#define SCIFFTX_RUN 0x2000u
#define SCIFFRX_RUN 0x2000u
#define SCIFFRX_OVERFLOW 0x8000u
#define SCIFFRX_CLEAR_OVERFLOW 0x4000u
#define FIFO_LEVEL_SHIFT 8u
#define FIFO_LEVEL 0x001Fu
#define FIFO_DEPTH 16u
#define OCTET 0x00FFu

/* Nearest divider: cutting off instead would make 115200 baud 1.7 % too fast. */
static uint32_t divider(const ht_port *port, uint32_t baud)
{
    uint32_t eight = 8u * baud;
    return (port->sci_clock_Hz + (eight / 2u)) / eight;
}

bool ht_sci_start(ht_port *port, uint32_t baud)
{
    uint32_t sci = port->map->sci;
    uint32_t counts;
    if ((baud == 0u) || (baud > (port->sci_clock_Hz / 16u))) {
        return false; /* a divider of 1 does not exist */
    }
    counts = divider(port, baud);
    if (counts > 65536u) {
        return false;
    }
    counts -= 1u;
    HT_WR16(port->io, sci + SCICTL1, 0u); /* software reset while it is changed */
    HT_WR16(port->io, sci + SCICCR, SCICCR_8N1);
    HT_WR16(port->io, sci + SCIHBAUD, (uint16_t)((counts >> 8) & OCTET));
    HT_WR16(port->io, sci + SCILBAUD, (uint16_t)(counts & OCTET));
    HT_WR16(port->io, sci + SCICTL2, 0u);            /* no interrupts: the background asks */
    HT_WR16(port->io, sci + SCIFFTX, SCIFFTX_FIFOS); /* empty both FIFOs ... */
    HT_WR16(port->io, sci + SCIFFRX, SCIFFRX_CLEAR_OVERFLOW);
    HT_WR16(port->io, sci + SCIFFCT, 0u);
    HT_WR16(port->io, sci + SCIFFTX, SCIFFTX_FIFOS | SCIFFTX_RUN); /* ... and let them run */
    HT_WR16(port->io, sci + SCIFFRX, SCIFFRX_RUN);
    HT_WR16(port->io, sci + SCICTL1, SCICTL1_RUN);
    return true;
}

float ht_sci_baud(const ht_port *port)
{
    uint32_t sci = port->map->sci;
    uint32_t high = HT_RD16(port->io, sci + SCIHBAUD);
    uint32_t low = HT_RD16(port->io, sci + SCILBAUD);
    uint32_t counts = ((high << 8) | low) + 1u;
    return (float)port->sci_clock_Hz / (8.0f * (float)counts);
}

static uint16_t level(const ht_port *port, uint32_t fifo)
{
    uint16_t status = HT_RD16(port->io, port->map->sci + fifo);
    return (uint16_t)((status >> FIFO_LEVEL_SHIFT) & FIFO_LEVEL);
}

uint16_t ht_sci_read(ht_port *port, uint16_t *octets, uint16_t n)
{
    uint16_t there = level(port, SCIFFRX);
    uint16_t count = (there < n) ? there : n;
    uint16_t k;
    for (k = 0u; k < count; k++) {
        octets[k] = (uint16_t)(HT_RD16(port->io, port->map->sci + SCIRXBUF) & OCTET);
    }
    return count;
}

bool ht_sci_recover(ht_port *port)
{
    uint32_t sci = port->map->sci;
    bool lost = false;
    if ((HT_RD16(port->io, sci + SCIRXST) & SCIRXST_ERROR) != 0u) {
        HT_WR16(port->io, sci + SCICTL1, SCICTL1_RESET);
        HT_WR16(port->io, sci + SCICTL1, SCICTL1_RUN);
        lost = true;
    }
    if ((HT_RD16(port->io, sci + SCIFFRX) & SCIFFRX_OVERFLOW) != 0u) {
        HT_WR16(port->io, sci + SCIFFRX, SCIFFRX_RUN | SCIFFRX_CLEAR_OVERFLOW);
        lost = true;
    }
    return lost;
}

uint16_t ht_sci_write(ht_port *port, const uint16_t *octets, uint16_t n)
{
    uint16_t room = (uint16_t)(FIFO_DEPTH - level(port, SCIFFTX));
    uint16_t count = (room < n) ? room : n;
    uint16_t k;
    for (k = 0u; k < count; k++) {
        HT_WR16(port->io, port->map->sci + SCITXBUF, (uint16_t)(octets[k] & OCTET));
    }
    return count;
}

static uint16_t line_read(void *at, uint16_t *octets, uint16_t n, bool *lost)
{
    uint16_t count = ht_sci_read((ht_port *)at, octets, n);
    *lost = ht_sci_recover((ht_port *)at);
    return count;
}

static uint16_t line_write(void *at, const uint16_t *octets, uint16_t n)
{
    return ht_sci_write((ht_port *)at, octets, n);
}

ht_line ht_sci_line(ht_port *port)
{
    float octets_per_s = ht_sci_baud(port) * 0.1f; /* start, 8, stop */
    ht_line line;
    line.read = line_read;
    line.write = line_write;
    line.at = port;
    line.octets_per_s = (uint32_t)octets_per_s;
    return line;
}
