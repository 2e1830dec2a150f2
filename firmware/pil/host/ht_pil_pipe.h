/* The pipes to a target's process. They are the system's; nothing else of the host's end is. */
#ifndef HT_PIL_PIPE_H
#define HT_PIL_PIPE_H

#include <stdbool.h>
#include <stdint.h>

/* The results of a transfer that are no number of bytes. */
#define HT_PIPE_LATER (-1) /* nothing now: wait */
#define HT_PIPE_CLOSED (-2)

/* A clock that never goes back. */
int64_t ht_pipe_now_ms(void);

/* Wait until the descriptor is ready, or closed, which the transfer will tell. False after the
 * time. */
bool ht_pipe_wait(int fd, bool to_write, int64_t until_ms);

/* Transfer up to n bytes without waiting. Returns their number, at least 1. */
int ht_pipe_write(int fd, const unsigned char *bytes, uint16_t n);
int ht_pipe_read(int fd, unsigned char *bytes, uint16_t n);

#endif
