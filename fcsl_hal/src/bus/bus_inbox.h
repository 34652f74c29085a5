/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of one key that came and were not yet taken. One thread at a time puts, another one takes, and neither waits.
 *
 * Of depth 1 it is the newest message (fcsl_latest.h), else a queue of slots. Its `head` and `tail` count messages: who puts stores head
 * with release behind the slot's bytes, who takes loads it with acquire before it reads them; and the other way round with tail, so that a
 * slot is used again only when it has been read. Zenoh calls from several threads, one at a time for each key.
 */
#ifndef FCSL_BUS_INBOX_H
#define FCSL_BUS_INBOX_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

#include "fcsl/fcsl_latest.h"

typedef enum { INBOX_TAKEN, INBOX_REPLACED, INBOX_OVERFLOWED, INBOX_WRONG_SIZE, INBOX_MISFIT } inbox_result_t;

typedef struct {
    uint32_t bytes; /* of a slot */
    uint32_t least; /* of a message */
    uint32_t depth;
    int quiet; /* see fcsl_bus_input_t, as of the next two */
    int (*fits)(uint64_t what, const uint8_t *bytes, size_t size);
    uint64_t what;
    fcsl_latest_t latest; /* depth 1; a slot is a size and that many bytes, here as below */
    uint8_t *slots; /* depth > 1 */
    _Atomic uint64_t head; /* messages that ever came in */
    _Atomic uint64_t tail; /* and went out */
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
