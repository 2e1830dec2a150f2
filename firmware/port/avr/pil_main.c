/* Processor in the loop on an ATmega2560 with external memory, over its serial port.
 * Only simulated so far (port/avr/simulator). */
#include <avr/io.h>

#include "ht_pil.h"

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
    static ht_pil pil;
    static ht_frame request;
    static ht_frame reply;
    UBRR0 = 0u; /* 2 Mbaud at 16 MHz */
    UCSR0A = (unsigned char)(1u << U2X0);
    UCSR0B = (unsigned char)((1u << RXEN0) | (1u << TXEN0));
    ht_pil_reset(&pil);
    ht_frame_reset(&request);
    for (;;) {
        unsigned char octet = receive();
        uint16_t size = 0u;
        uint16_t used;
        uint16_t i;
        ht_frame_status status = ht_frame_take(&request, &octet, 1u, &used);
        if (status == HT_FRAME_WHOLE) {
            size = ht_pil_answer(&pil, &request, &reply);
        } else if (status == HT_FRAME_BROKEN) {
            size = ht_pil_complain(&reply);
        } else {
            /* more to come */
        }
        for (i = 0u; i < size; i++) {
            send(ht_frame_octet(&reply, i));
        }
    }
}
