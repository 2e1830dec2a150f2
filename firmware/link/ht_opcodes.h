/** @file ht_opcodes.h
 *  Opcodes: the first byte of a frame's body. Requests of the drive's link (ht_service.h,
 *  docs/protocol.md) and of processor in the loop (ht_pil.h, docs/pil.md) have different
 *  numbers: an image that serves the one refuses a request of the other.
 */
#ifndef HT_OPCODES_H
#define HT_OPCODES_H

enum {
    HT_OP_HELLO = 0x01,
    HT_OP_LIST = 0x02,
    HT_OP_OPEN = 0x03,
    HT_OP_CLOSE = 0x04,
    HT_OP_STATUS = 0x05,
    HT_OP_GET = 0x06,
    HT_OP_WRITE = 0x07,
    /** Only from the host that holds the session. The same START received again does not start
     *  the drive again. */
    HT_OP_START = 0x08,
    /** From anybody who reaches the line, at any time, with or without a session. Every STOP that
     *  arrives stops the drive, a repeated one too. */
    HT_OP_STOP = 0x09,
    HT_OP_CLEAR = 0x0A,
    HT_OP_STREAM = 0x0B,
    HT_OP_ARM = 0x0C,
    HT_OP_CAPTURE = 0x0D,
    HT_OP_READ = 0x0E,
    HT_OP_TRIGGER = 0x0F,
    HT_OP_CANCEL = 0x10,
    HT_OP_SNAPSHOT = 0x11,
    HT_OP_SAVE = 0x12,
    HT_OP_FORGET = 0x13,
    HT_OP_FORGET_LOG = 0x14,
    HT_OP_LAST = HT_OP_FORGET_LOG, /**< of the link; those of processor in the loop follow */
    HT_OP_PIL_HELLO = 0x20,        /**< who is there? */
    HT_OP_PIL_INIT = 0x21,         /**< a new drive, as after a reset */
    HT_OP_PIL_STEP = 0x22,         /**< run interrupts */
    HT_OP_PIL_START = 0x23,
    HT_OP_PIL_STOP = 0x24,
    HT_OP_PIL_CLEAR = 0x25,
    HT_OP_PIL_SET = 0x26,      /**< write a parameter */
    HT_OP_PIL_GET = 0x27,      /**< read a parameter */
    HT_OP_PIL_SNAPSHOT = 0x28, /**< what the latest fault left */
    HT_OP_PIL_DAMAGED = 0x3F   /**< only as a reply: a frame arrived damaged */
};

/** A reply has its request's opcode plus this. */
enum { HT_OP_REPLY = 0x80 };

#endif
