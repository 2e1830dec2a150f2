#define _POSIX_C_SOURCE 200809L

#include "ht_pil_pipe.h"

#ifdef _WIN32

/* No emulator runs there: every pipe is closed. */

int64_t ht_pipe_now_ms(void)
{
    return 0;
}

bool ht_pipe_wait(int fd, bool to_write, int64_t until_ms)
{
    (void)fd;
    (void)to_write;
    (void)until_ms;
    return true;
}

int ht_pipe_write(int fd, const unsigned char *bytes, uint16_t n)
{
    (void)fd;
    (void)bytes;
    (void)n;
    return HT_PIPE_CLOSED;
}

int ht_pipe_read(int fd, unsigned char *bytes, uint16_t n)
{
    (void)fd;
    (void)bytes;
    (void)n;
    return HT_PIPE_CLOSED;
}

#else

#include <errno.h>
#include <poll.h>
#include <time.h>
#include <unistd.h>

int64_t ht_pipe_now_ms(void)
{
    struct timespec t;
    (void)clock_gettime(CLOCK_MONOTONIC, &t);
    return (int64_t)t.tv_sec * 1000 + t.tv_nsec / 1000000;
}

bool ht_pipe_wait(int fd, bool to_write, int64_t until_ms)
{
    for (;;) {
        struct pollfd p;
        int64_t left = until_ms - ht_pipe_now_ms();
        int n;
        p.fd = fd;
        p.events = to_write ? POLLOUT : POLLIN;
        p.revents = 0;
        n = (left > 0) ? poll(&p, 1, (int)left) : 0;
        if (n > 0) {
            return true;
        }
        if ((n == 0) || (errno != EINTR)) {
            return false;
        }
    }
}

static int done(ssize_t n)
{
    if (n > 0) {
        return (int)n;
    }
    return ((n < 0) && ((errno == EAGAIN) || (errno == EINTR))) ? HT_PIPE_LATER : HT_PIPE_CLOSED;
}

int ht_pipe_write(int fd, const unsigned char *bytes, uint16_t n)
{
    return done(write(fd, bytes, (size_t)n));
}

int ht_pipe_read(int fd, unsigned char *bytes, uint16_t n)
{
    return done(read(fd, bytes, (size_t)n));
}

#endif
