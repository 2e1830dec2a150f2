/* A drive with its link on the register model and its line in memory. It can return to one of a few
 * states at once. */
#ifndef RIG_H
#define RIG_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "ht_port_c2000.h"
#include "ht_service_requests.h"

#define RIG_MEMORY 96u /* values for captures: a few rows of a few channels */
#define RIG_BLOCKS 64u /* of an area of the parameter store */
#define RIG_LOG_BLOCKS (HT_LOG_SLOTS * HT_LOG_BLOCKS)
#define RIG_LINE 4096u /* octets on their way to the device */
#define RIG_TICKS 256u /* fast interrupts that one input may take */
#define RIG_WATCHDOG_MS 8u
#define RIG_WATCHDOG_TICKS 20u /* at the rate that the rig begins with */

/* Where an input begins. */
enum {
    RIG_IDLE, /* nobody has a session */
    RIG_SESSION,
    RIG_RUNNING,  /* started by the session */
    RIG_LOST,     /* the watchdog has stopped it: a fault, no session */
    RIG_CAPTURED, /* idle, streams on, a capture complete */
    RIG_BUSY,     /* running, streams on, a capture waits */
    RIG_DEBUGGER, /* running, started by a debugger, while there is a session */
    RIG_STARTS
};
#define RIG_NONCE 0x1234u

typedef struct {
    ht_drive drive;
    ht_service service;
    ht_port port;
    ht_regfile *registers;
    uint32_t *memory;
    uint16_t in[RIG_LINE]; /* to the device */
    uint32_t in_n;
    uint32_t in_at;
    uint32_t room;    /* octets that the line still takes from the device */
    bool lost;        /* the receiver reports it once */
    bool isr_in_read; /* a fast interrupt comes in the middle of a turn */
    bool isr_in_write;
    ht_store store;
    ht_drive_log log;
    uint16_t stored[HT_STORE_AREAS][RIG_BLOCKS * HT_STORE_WORDS];
    uint16_t logged[HT_STORE_AREAS][RIG_LOG_BLOCKS * HT_STORE_WORDS];
    uint32_t store_writes; /* of the turn under way */
    uint32_t ticks;        /* fast interrupts of this input */
    uint8_t id;            /* of the latest request */
} rig;

extern rig the_rig;

/* The first call sets it up, which takes some time. */
void rig_begin(unsigned start);

/* `rules_fast` and `rules_turn` follow each. */
void rig_fast(void);
void rig_turn(void);
void rig_slow(void);

void rig_put(const uint8_t *octets, size_t n);
/* A body as a complete frame. */
void rig_put_body(const uint8_t *body, size_t n);
/* A request of `session` with the dictionary's CRC and the next id. */
void rig_ask(uint8_t opcode, uint16_t session, const uint8_t *payload, size_t n);
/* Turns, and an interrupt now and then, until all is read and the replies are sent. */
void rig_settle(void);
/* Sensor `which`: 0 .. 5 currents, 6 the dc-link, 7 the encoder. */
void rig_sense(unsigned which, uint16_t value);
bool rig_gates_off(void);
/** The trip pin goes to a level; true: high. */
void rig_trip_pin(bool high);
bool rig_trip_pin_low(void);

#endif
