#include "semihost.h"

#include <string.h>

#define SYS_OPEN 0x01u
#define SYS_WRITE 0x05u
#define SYS_READ 0x06u
#define SYS_SEEK 0x0Au
#define SYS_EXIT_EXTENDED 0x20u
#define APPLICATION_EXIT 0x20026u

static uint32_t call(uint32_t operation, const void *arguments)
{
    register uint32_t r0 __asm("r0") = operation;
    register const void *r1 __asm("r1") = arguments;
    __asm volatile("bkpt 0xAB" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

int32_t semihost_open(const char *name, uint32_t mode)
{
    uint32_t arguments[3];
    arguments[0] = (uint32_t)name;
    arguments[1] = mode;
    arguments[2] = (uint32_t)strlen(name);
    return (int32_t)call(SYS_OPEN, arguments);
}

uint32_t semihost_read(int32_t handle, void *data, uint32_t size)
{
    uint32_t arguments[3];
    uint32_t missing;
    arguments[0] = (uint32_t)handle;
    arguments[1] = (uint32_t)data;
    arguments[2] = size;
    missing = call(SYS_READ, arguments);
    return (missing <= size) ? (size - missing) : 0u;
}

int semihost_write(int32_t handle, const void *data, uint32_t size)
{
    uint32_t arguments[3];
    arguments[0] = (uint32_t)handle;
    arguments[1] = (uint32_t)data;
    arguments[2] = size;
    return call(SYS_WRITE, arguments) == 0u;
}

int semihost_seek(int32_t handle, uint32_t octet)
{
    uint32_t arguments[2];
    arguments[0] = (uint32_t)handle;
    arguments[1] = octet;
    return call(SYS_SEEK, arguments) == 0u;
}

void semihost_exit(uint32_t status)
{
    uint32_t arguments[2];
    arguments[0] = APPLICATION_EXIT;
    arguments[1] = status;
    for (;;) {
        (void)call(SYS_EXIT_EXTENDED, arguments);
    }
}
