/* A model of what docs/protocol.md promises. It is compared with the device. */
#ifndef RULES_H
#define RULES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "ht_service.h"
#include "reference.h"

#define RULES_PARAMS 256u
#define RULES_FRAME (2u * REFERENCE_FRAME)

/* Octets of one direction that no zero has closed yet. */
typedef struct {
    uint32_t n; /* more than RULES_FRAME: too long */
    bool damaged;
    uint8_t octet[RULES_FRAME];
} rules_frame;

typedef struct {
    uint16_t session;
    uint32_t mark;
    uint32_t session_tick; /* of its latest request */
    bool elsewhere;        /* the drive was started by a debugger */
    bool answered;
    uint32_t last_crc;  /* of the latest request that was carried out */
    bool started;       /* a START, and its session has sent nothing else since */
    uint32_t start_crc; /* of this START */
    ht_packet reply;    /* and what was answered */
    ht_packet previous; /* the one before may still be on its way */
    uint32_t damaged;
    float value[RULES_PARAMS]; /* of the parameters */
    rules_frame to;            /* the device */
    rules_frame from;
} rules;

extern rules the_rules;

void rules_begin(void);
void rules_debugger_starts(bool done);
/* After a fast interrupt. */
void rules_fast(void);
/* Around a turn of the background, and what the line does in it. */
void rules_before_turn(void);
void rules_turn(void);
void rules_read(const uint16_t *octets, uint16_t n, bool lost);
void rules_write(const uint16_t *octets, uint16_t n);

/* All parameters have the expected values, within their ranges. */
void rules_parameters(void);

/* Fast interrupts per second: whole counts of the PWM clock. */
double rules_rate_Hz(void);

/* rules_requests.c. The state that a request finds. */
typedef struct {
    uint16_t state;
    uint32_t faults;
    uint16_t capture;
    uint16_t capture_number;
    uint32_t tick;
    ht_stream stream[HT_STREAMS];
    ht_burst_setup setup;
} rules_before;

/* The request `body` was carried out; `disturbed`: an interrupt came after it. */
void rules_request(const uint8_t *body, size_t n, const rules_before *before, bool disturbed);

#endif
