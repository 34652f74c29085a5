/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands in the slot of fcsl-guard: writing and taking. Words are stored with release and loaded with acquire, so a reader
 * that has seen one word of a command also sees the odd sequence that was stored before it; on x86 both are plain moves.
 */
#include "fcsl/fcsl_guard.h"

#include <string.h>

/* Times that a reader looks again when the writer was at work meanwhile. */
enum { TRIES = 8, WORD_BYTES = 8 };

_Static_assert(ATOMIC_LLONG_LOCK_FREE == 2, "the words of the slot need no lock");

static size_t words_of(size_t bytes)
{
    return (bytes + WORD_BYTES - 1u) / WORD_BYTES;
}

size_t fcsl_guard_slot_bytes(const fcsl_machine_t *machine)
{
    return sizeof(fcsl_guard_slot_t) + words_of(fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE)) * WORD_BYTES;
}

int fcsl_guard_command(const fcsl_guard_link_t *link, const fcsl_message_t *message, uint64_t begun_ns)
{
    fcsl_guard_slot_t *slot = link->slot;
    if (slot == NULL) {
        return 0;
    }
    if (message->size > link->capacity) {
        return -1;
    }
    const uint64_t sequence = atomic_load_explicit(&slot->sequence, memory_order_relaxed) | 1u;
    atomic_store_explicit(&slot->sequence, sequence, memory_order_relaxed);
    atomic_store_explicit(&slot->begun_ns, begun_ns, memory_order_release);
    atomic_store_explicit(&slot->size, message->size, memory_order_release);
    for (size_t at = 0; at < message->size; at += WORD_BYTES) {
        const size_t left = message->size - at;
        uint64_t word = 0;
        memcpy(&word, message->bytes + at, left < WORD_BYTES ? left : WORD_BYTES);
        atomic_store_explicit(&slot->message[at / WORD_BYTES], word, memory_order_release);
    }
    atomic_store_explicit(&slot->sequence, sequence + 1u, memory_order_release);
    return 0;
}

/* Copies the command of this sequence. Nothing in the slot is trusted: what is used twice is read once. */
static void copy(const fcsl_guard_server_t *server, uint8_t *bytes, size_t *size, uint64_t *begun_ns)
{
    const fcsl_guard_slot_t *slot = server->slot;
    *begun_ns = atomic_load_explicit(&slot->begun_ns, memory_order_acquire);
    const uint64_t said = atomic_load_explicit(&slot->size, memory_order_acquire);
    *size = said <= server->capacity ? (size_t)said : 0u;
    for (size_t at = 0; at < *size; at += WORD_BYTES) {
        const size_t left = *size - at;
        const uint64_t word = atomic_load_explicit(&slot->message[at / WORD_BYTES], memory_order_acquire);
        memcpy(bytes + at, &word, left < WORD_BYTES ? left : WORD_BYTES);
    }
}

int fcsl_guard_take(fcsl_guard_server_t *server, uint8_t *bytes, size_t *size, uint64_t *begun_ns)
{
    for (int i = 0; i < TRIES && server->client >= 0; i++) {
        const uint64_t sequence = atomic_load_explicit(&server->slot->sequence, memory_order_acquire);
        if (sequence == server->taken || (sequence & 1u) != 0u) {
            return 0;
        }
        copy(server, bytes, size, begun_ns);
        if (atomic_load_explicit(&server->slot->sequence, memory_order_relaxed) == sequence) {
            server->taken = sequence;
            return 1;
        }
    }
    return 0;
}
