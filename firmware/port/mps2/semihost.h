/** @file semihost.h
 *  Files of the machine that runs the emulator, by Arm semihosting.
 */
#ifndef SEMIHOST_H
#define SEMIHOST_H

#include <stdint.h>

enum {
    SEMIHOST_READ = 1 /* "rb" */,
    SEMIHOST_UPDATE = 3 /* "r+b" */,
    SEMIHOST_WRITE = 5 /* "wb" */
};

/** A handle, or -1. Names are relative to the emulator's working directory. */
int32_t semihost_open(const char *name, uint32_t mode);

/** Bytes read, at most `size`; 0 at the end of the file. Of a pipe what is there,
 *  once something is. */
uint32_t semihost_read(int32_t handle, void *data, uint32_t size);

/** True if all was written. */
int semihost_write(int32_t handle, const void *data, uint32_t size);

/** Go on reading or writing at a byte of the file. True if that is possible. */
int semihost_seek(int32_t handle, uint32_t octet);

/** End the emulation with this exit status. */
void semihost_exit(uint32_t status) __attribute__((noreturn));

#endif
