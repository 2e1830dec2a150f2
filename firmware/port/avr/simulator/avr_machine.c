/* An ATmega2560 with 64 KB of data memory, simulated: its serial port is a pair of
 * pipes in the working directory, `to_target` and `from_target`.
 *
 *   avr_machine IMAGE.elf        cc -O2 avr_machine.c -lsimavr -lelf
 *   avr_machine IMAGE.elf -      no pipes: what it sends goes to standard output, until it
 *                                sleeps with interrupts off
 */
#include <fcntl.h>
#include <poll.h>
#include <simavr/avr_uart.h>
#include <simavr/sim_avr.h>
#include <simavr/sim_elf.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#define CYCLES_BETWEEN_LOOKS 2000 /* at the pipe */
#define UCSR0B 0xC1
#define RXEN0 0x10 /* before its program sets this bit the serial port hears nothing */

static int from_target = -1;
static int ready = 1; /* the serial port takes another byte */
static unsigned char out[4096];
static size_t waiting;

static void flush(void)
{
    size_t done = 0;
    while (done < waiting) {
        ssize_t n = write(from_target, out + done, waiting - done);
        if (n <= 0) {
            exit(1);
        }
        done += (size_t)n;
    }
    waiting = 0;
}

static void sent(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)param;
    out[waiting++] = (unsigned char)value;
    if (waiting == sizeof out) {
        flush();
    }
}

static void xon(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    (void)param;
    ready = 1;
}

static void xoff(struct avr_irq_t *irq, uint32_t value, void *param)
{
    (void)irq;
    (void)value;
    (void)param;
    ready = 0;
}

int main(int argc, char **argv)
{
    elf_firmware_t firmware;
    avr_t *avr;
    avr_irq_t *input;
    uint32_t flags = 0;
    unsigned char in[4096];
    ssize_t have = 0;
    ssize_t given = 0;
    int to_target;
    memset(&firmware, 0, sizeof firmware);
    avr = avr_make_mcu_by_name("atmega2560");
    int alone = (argc == 3) && (strcmp(argv[2], "-") == 0);
    if (((argc != 2) && !alone) || (avr == NULL) || (elf_read_firmware(argv[1], &firmware) != 0)) {
        fprintf(stderr, "usage: %s IMAGE.elf\n", argv[0]);
        return 2;
    }
    if (alone) { /* the simulator talks on standard output as well */
        from_target = dup(STDOUT_FILENO);
        (void)dup2(STDERR_FILENO, STDOUT_FILENO);
    }
    avr->ramend = 0xFFFF; /* with external memory */
    avr_init(avr);
    avr->frequency = 16000000;
    avr_load_firmware(avr, &firmware);
    (void)avr_ioctl(avr, AVR_IOCTL_UART_GET_FLAGS('0'), &flags);
    flags &= ~(uint32_t)(AVR_UART_FLAG_STDIO | AVR_UART_FLAG_POLL_SLEEP);
    (void)avr_ioctl(avr, AVR_IOCTL_UART_SET_FLAGS('0'), &flags);
    input = avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_INPUT);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUTPUT), sent,
                            NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XON), xon,
                            NULL);
    avr_irq_register_notify(avr_io_getirq(avr, AVR_IOCTL_UART_GETIRQ('0'), UART_IRQ_OUT_XOFF), xoff,
                            NULL);
    to_target = open(alone ? "/dev/null" : "to_target", O_RDONLY);
    from_target = alone ? from_target : open("from_target", O_WRONLY);
    if ((to_target < 0) || (from_target < 0)) {
        return 2;
    }
    for (;;) {
        avr_cycle_count_t until = avr->cycle + CYCLES_BETWEEN_LOOKS;
        while (avr->cycle < until) {
            int state = avr_run(avr);
            if ((state == cpu_Done) || (state == cpu_Crashed)) {
                flush();
                return (alone && (state == cpu_Done)) ? 0 : 70;
            }
            while (ready && (given < have) && ((avr->data[UCSR0B] & RXEN0) != 0)) {
                avr_raise_irq(input, in[given++]);
            }
        }
        flush();
        if (!alone && (given == have)) {
            struct pollfd p = {.fd = to_target, .events = POLLIN, .revents = 0};
            if (poll(&p, 1, 0) > 0) {
                have = read(to_target, in, sizeof in);
                given = 0;
                if (have <= 0) {
                    return 0; /* nobody is there any more */
                }
            }
        }
    }
}
