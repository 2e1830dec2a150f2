/* A test program of the host on an ATmega2560: its tables stay in program memory, and its output
 * goes to the serial port. PROGRAM: its source. */
#include <avr/interrupt.h>
#include <avr/io.h>
#include <avr/pgmspace.h>
#include <avr/sleep.h>
#include <stdio.h>

#define HT_ROM PROGMEM
#define HT_ROM_ROW(to, from) memcpy_P((to), (from), sizeof *(to))

int program(void);
#define main program
#include PROGRAM
#undef main

static int put(char c, FILE *stream)
{
    (void)stream;
    while ((UCSR0A & (1u << UDRE0)) == 0u) {
    }
    UDR0 = (unsigned char)c;
    return 0;
}

int main(void)
{
    static FILE serial = FDEV_SETUP_STREAM(put, NULL, _FDEV_SETUP_WRITE);
    UCSR0B = (unsigned char)(1u << TXEN0);
    stdout = &serial;
    printf("status %d\n", program());
    while ((UCSR0A & (1u << TXC0)) == 0u) {
    }
    cli();
    sleep_enable();
    sleep_cpu();
    return 0;
}
