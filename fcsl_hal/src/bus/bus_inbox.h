/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of one key that came and were not yet taken. One thread at a time puts, another one takes, and neither waits.
 */
#ifndef FCSL_BUS_INBOX_H
#define FCSL_BUS_INBOX_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

typedef enum { INBOX_TAKEN, INBOX_REPLACED, INBOX_OVERFLOWED, INBOX_WRONG_SIZE, INBOX_MISFIT } inbox_result_t;

typedef struct {
    uint32_t bytes; /* of a slot */
    uint32_t least; /* of a message */
    uint32_t depth;
    int quiet; /* see fcsl_bus_input_t, as of the next two */
    int (*fits)(uint64_t what, const uint8_t *bytes, size_t size);
    uint64_t what;
    uint8_t *slots;
    uint32_t *sizes; /* of what lies in the slots */
    /* depth > 1: a queue. Messages that ever came in and went out. */
    _Atomic uint64_t head;
    _Atomic uint64_t tail;
    /* depth 1: three slots. One belongs to who puts, one to who takes; the third changes hands, and is marked while its
     * message is new. */
    uint32_t back;
    uint32_t front;
    _Atomic uint32_t middle;
} inbox_t;

/* Bytes that inbox_open allocates. */
uint64_t inbox_memory(uint32_t bytes, uint32_t depth);

/* 0, or -1 when there is no memory. */
int inbox_open(inbox_t *inbox, uint32_t bytes, uint32_t least, uint32_t depth);
void inbox_close(inbox_t *inbox);

/* INBOX_REPLACED: taken, and the message before it never was. */
inbox_result_t inbox_put(inbox_t *inbox, const uint8_t *bytes, size_t size);

/* Copies the next message: 1. 0: there is none. */
int inbox_take(inbox_t *inbox, void *bytes, size_t *size);

#endif /* FCSL_BUS_INBOX_H */
