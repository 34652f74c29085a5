/* SPDX-License-Identifier: Apache-2.0
 *
 * A ring of actuator messages.
 */
#include "delay.h"

#include <stdlib.h>
#include <string.h>

int fcsl_delay_open(fcsl_delay_t *delay, uint32_t ticks, size_t capacity)
{
    *delay = (fcsl_delay_t){.ticks = ticks, .slot_bytes = sizeof(uint64_t) + capacity};
    delay->slots = calloc((size_t)ticks + 1u, delay->slot_bytes);
    return delay->slots != NULL ? 0 : -1;
}

void fcsl_delay_free(fcsl_delay_t *delay)
{
    free(delay->slots);
    *delay = (fcsl_delay_t){0};
}

static uint8_t *slot_of(const fcsl_delay_t *delay, uint64_t tick)
{
    return delay->slots + (size_t)(tick % (delay->ticks + 1u)) * delay->slot_bytes;
}

/* Keeps the message of a tick; none has size 0. */
static void keep(fcsl_delay_t *delay, uint64_t tick, const fcsl_message_t *message)
{
    uint64_t size = message != NULL ? message->size : 0u;
    uint8_t *slot = slot_of(delay, tick);
    if (size > delay->slot_bytes - sizeof size) {
        size = 0; /* not reached: the capacity is that of the longest message */
    }
    memcpy(slot, &size, sizeof size);
    if (size > 0) {
        memcpy(slot + sizeof size, message->bytes, (size_t)size);
    }
}

int fcsl_delay_pass(fcsl_delay_t *delay, const fcsl_channel_table_t *table, uint64_t tick,
                    const fcsl_message_t *message, fcsl_message_t *due)
{
    uint64_t size = 0;
    if (delay->ticks == 0) {
        if (message != NULL) {
            *due = *message;
        }
        return message != NULL;
    }
    keep(delay, tick, message);
    if (tick < delay->ticks) {
        return 0;
    }
    const uint8_t *slot = slot_of(delay, tick - delay->ticks);
    memcpy(&size, slot, sizeof size);
    /* Checked again, since a checkpoint may have brought it. */
    return size > 0 && size <= delay->slot_bytes - sizeof size &&
           fcsl_message_check(table, FCSL_ACTUATOR_MESSAGE, slot + sizeof size, (size_t)size, due) == FCSL_MESSAGE_OK;
}

size_t fcsl_delay_bytes(const fcsl_delay_t *delay)
{
    return ((size_t)delay->ticks + 1u) * delay->slot_bytes;
}
