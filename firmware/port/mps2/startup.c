/* Start-up of a Cortex-M with FPU on the MPS2 boards that QEMU emulates. */
#include <stdint.h>
#include <string.h>

#include "semihost.h"

#define CPACR (*(volatile uint32_t *)0xE000ED88u)
#define CPACR_FPU (0xFu << 20)
#define EXIT_FAULT 70u

extern uint32_t ht_stack_top, ht_data_load, ht_data_start, ht_data_end, ht_bss_start, ht_bss_end;

int main(void);
void reset(void);
void fault(void);

/* A fault ends the emulation with an error: left alone it would spin for ever. */
void fault(void)
{
    semihost_exit(EXIT_FAULT);
}

void reset(void)
{
    CPACR |= CPACR_FPU;
    __asm volatile("dsb\n\tisb");
    memcpy(&ht_data_start, &ht_data_load, (uint32_t)&ht_data_end - (uint32_t)&ht_data_start);
    memset(&ht_bss_start, 0, (uint32_t)&ht_bss_end - (uint32_t)&ht_bss_start);
    semihost_exit((uint32_t)main());
}

/* No interrupt is ever enabled: the loop around the drive calls its handlers. */
typedef struct {
    const void *stack;
    void (*reset)(void);
    void (*handler[14])(void);
} vector_table;

__attribute__((section(".vectors"), used)) static const vector_table vectors = {
    &ht_stack_top,
    reset,
    /* NMI, HardFault, MemManage, BusFault, UsageFault, ..., SVCall, ..., PendSV, SysTick */
    {fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault, fault,
     fault},
};
