/* Processor in the loop on an ATmega2560 with external memory, over its serial port.
 * Only simulated so far (port/avr/simulator). */
#include <avr/io.h>

#include "ht_pil_line.h"

/* The bus of the external memory on (SRE in XMCRA), before the data are copied there. */
__asm(".section .init1,\"ax\",@progbits\n\tldi r24, 0x80\n\tsts 0x74, r24\n\t.text");

static unsigned char receive(void)
{
    while ((UCSR0A & (1u << RXC0)) == 0u) {
    }
    return UDR0;
}

static void send(unsigned char octet)
{
    while ((UCSR0A & (1u << UDRE0)) == 0u) {
    }
    UDR0 = octet;
}

int main(void)
{
    static ht_pil_line line;
    UBRR0 = 0u; /* 2 Mbaud at 16 MHz */
    UCSR0A = (unsigned char)(1u << U2X0);
    UCSR0B = (unsigned char)((1u << RXEN0) | (1u << TXEN0));
    ht_pil_line_reset(&line);
    for (;;) {
        if (ht_pil_line_take(&line, receive())) {
            uint16_t i;
            for (i = 0u; i < line.out.n; i++) {
                send((unsigned char)line.out.octet[i]);
            }
        }
    }
}
