/* SPDX-License-Identifier: Apache-2.0
 *
 * The newest values from one thread to another. Neither waits for the other: each has a slot of its own, and both exchange theirs for
 * the third one.
 */
#ifndef BOARD_TRIPLE_BUFFER_H
#define BOARD_TRIPLE_BUFFER_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

enum { TRIPLE_BUFFER_SLOTS = 3 };

typedef struct {
    uint8_t *slots;
    size_t slot_size;
    uint64_t numbers[TRIPLE_BUFFER_SLOTS]; /* of the put that filled the slot */
    uint64_t puts;
    uint32_t back; /* the writer's slot */
    uint32_t front; /* the reader's slot */
    atomic_uint middle; /* the third slot, and whether it is new to the reader */
} triple_buffer_t;

/* For values of `size` bytes. 0, or -1: out of memory. */
int triple_buffer_open(triple_buffer_t *buffer, size_t size);
void triple_buffer_close(triple_buffer_t *buffer);

/* From the writer's thread: where the next values go, all of them; what lies there is old. */
void *triple_buffer_back(const triple_buffer_t *buffer);
/* From the writer's thread: hands over what lies there, in the place of what was not taken. Puts are numbered from 1 on. Returns whether
 * the reader had taken the one before: then it is to be woken. */
int triple_buffer_put(triple_buffer_t *buffer);

/* From the reader's thread: takes the newest values and returns the number of their put; 0: there are none since the last ones. */
uint64_t triple_buffer_take(triple_buffer_t *buffer);
/* From the reader's thread: the values that were taken last. */
const void *triple_buffer_front(const triple_buffer_t *buffer);

#endif /* BOARD_TRIPLE_BUFFER_H */
