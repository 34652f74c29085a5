/* SPDX-License-Identifier: Apache-2.0
 *
 * Commands in the slot of fcsl-guard, a seqlock between two processes: the step thread of the flight program writes, the loop of the
 * guard takes. The guard trusts nothing that lies there: a writer that does not keep to the rules, or dies in between, costs it a
 * bounded number of tries and no command, or one whose bytes do not pass the check of messages.
 */
#include "fcsl/fcsl_guard.h"

#include "fcsl/fcsl_seqlock.h"

/* Times that a reader looks again when the writer was at work meanwhile. */
enum { TRIES = 8 };

size_t fcsl_guard_slot_bytes(const fcsl_machine_t *machine)
{
    return sizeof(fcsl_guard_slot_t) +
           fcsl_seqlock_words(fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE)) * FCSL_SEQLOCK_WORD_BYTES;
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
    fcsl_seqlock_begin(&slot->sequence, sequence);
    atomic_store_explicit(&slot->begun_ns, begun_ns, memory_order_release);
    atomic_store_explicit(&slot->size, message->size, memory_order_release);
    fcsl_seqlock_store(slot->message, message->bytes, message->size);
    fcsl_seqlock_end(&slot->sequence, sequence + 1u);
    return 0;
}

/* Copies the command of this sequence. Nothing in the slot is trusted: what is used twice is read once. */
static void copy(const fcsl_guard_server_t *server, uint8_t *bytes, size_t *size, uint64_t *begun_ns)
{
    const fcsl_guard_slot_t *slot = server->slot;
    *begun_ns = atomic_load_explicit(&slot->begun_ns, memory_order_acquire);
    const uint64_t stored = atomic_load_explicit(&slot->size, memory_order_acquire);
    *size = stored <= server->capacity ? (size_t)stored : 0u;
    fcsl_seqlock_load(bytes, slot->message, *size);
}

int fcsl_guard_take(fcsl_guard_server_t *server, uint8_t *bytes, size_t *size, uint64_t *begun_ns)
{
    for (int i = 0; i < TRIES && server->client >= 0; i++) {
        const uint64_t sequence = atomic_load_explicit(&server->slot->sequence, memory_order_acquire);
        if (sequence == server->taken || (sequence & 1u) != 0u) {
            return 0;
        }
        copy(server, bytes, size, begun_ns);
        if (fcsl_seqlock_unchanged(&server->slot->sequence, sequence)) {
            server->taken = sequence;
            return 1;
        }
    }
    return 0;
}
