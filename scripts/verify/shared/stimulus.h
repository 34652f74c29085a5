/* SPDX-License-Identifier: Apache-2.0
 *
 * Deterministic inputs for any machine, found through its descriptor, and a hash over all its fields: what two runs of one
 * machine need to be compared, whoever compiled or interprets it. The same on every target: values are made of a counter by
 * integer arithmetic, and hashed by value.
 *
 *     d->init(machine);
 *     d->start(machine);
 *     stimulus_begin(d, machine);
 *     stimulus_host_t host;
 *     stimulus_host_begin(&host, seed);
 *     for (uint64_t tick = 0; tick < ticks; tick++) {
 *         host.tick = tick;
 *         stimulus_tick(d, machine, tick, seed);
 *         d->step(machine, &host.host);
 *         hash = stimulus_hash(d, machine, hash);
 *     }
 *
 * What a machine meets: writable inputs and outputs, and sensor channels, hold around a level for 64 ticks (full mantissas, so
 * that a rounding that differs shows); channels drop out for 16 ticks, or bring old samples; states are forced; parameters
 * move within their bounds in every other block of 256 ticks. The last quarter of a block is wild: infinities, NaNs,
 * subnormals, any bits; fields of state overwritten; faults, healths and overruns injected. A block begins with `init`, so that one
 * NaN does not cover what follows; every other time the count of ticks goes on nevertheless.
 */
#ifndef FCSL_VERIFY_STIMULUS_H
#define FCSL_VERIFY_STIMULUS_H

#include "fcsl/fcsl_hw.h"
#include "fcsl/fcsl_machine.h"

/* Attaches every sensor channel; once, after init. */
void stimulus_begin(const fcsl_machine_t *d, void *machine);

/* Before each step, `tick` counting from 0: writes what a host may write. May call init (and begins again) and force_state. */
void stimulus_tick(const fcsl_machine_t *d, void *machine, uint64_t tick, uint64_t seed);

/* A host whose hardware reads are functions of seed, tick and pin, and sometimes fail. Its clock stands still within a tick:
 * how often a step reads it is the emitter's own business; overruns are injected instead. */
typedef struct {
    uint64_t seed;
    uint64_t tick;    /* the caller keeps it */
    uint64_t written; /* hash over all hardware writes so far */
    struct fcsl_hw hw;
    fcsl_host_t host; /* for step */
} stimulus_host_t;

void stimulus_host_begin(stimulus_host_t *host, uint64_t seed);

/* `hash` (0 to begin) continued by every field of the descriptor, NaNs made canonical. */
uint64_t stimulus_hash(const fcsl_machine_t *d, const void *machine, uint64_t hash);

/* One scalar of a field, as the hash takes it: by value, zero-extended, NaNs canonical. */
uint64_t stimulus_word(const fcsl_field_t *field, const void *machine, uint32_t element);

/* `hash` continued by one word; for a given hash, different words give different hashes. */
uint64_t stimulus_mix(uint64_t hash, uint64_t word);

#endif /* FCSL_VERIFY_STIMULUS_H */
