/* SPDX-License-Identifier: Apache-2.0
 *
 * What reproduces the run elsewhere: a checkpoint for who asks, and the host's writes for who subscribes to them.
 */
#ifndef FCSL_OBSERVERS_REPRODUCTION_H
#define FCSL_OBSERVERS_REPRODUCTION_H

#include "publisher.h"

/* Bytes of the longest message, with its number. */
size_t fcsl_observers_write_bytes(const fcsl_journal_t *journal);

/* Puts the writes before a publication, and that these were all; nothing unless they are followed. Returns 0, or -1: there was
 * no room for all of them. */
int fcsl_observers_post_writes(fcsl_observers_t *o, const fcsl_moment_t *moment);

/* Makes the publication the checkpoint, if writes are followed and the one before is older than 20 ms. */
void fcsl_observers_answer_checkpoint(fcsl_observers_t *o, const fcsl_moment_t *moment);

#endif /* FCSL_OBSERVERS_REPRODUCTION_H */
