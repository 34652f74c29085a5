/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_RECORDER_INTERNAL_H
#define FCSL_RECORDER_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "bag.h"
#include "recorder.h"
#include "ring.h"

/* Topic numbers in the bag: fixed ones, then the instances in machine order, then added ones. */
enum {
    FCSL_TOPIC_STATE = 0,
    FCSL_TOPIC_TRANSITIONS = 1,
    FCSL_TOPIC_HEALTH = 2,
    FCSL_TOPIC_FAULTS = 3,
    FCSL_TOPIC_CHECKPOINT = 4,
    FCSL_TOPIC_WRITES = 5,
    FCSL_TOPIC_FIRST_INSTANCE = 6,
};

struct fcsl_recorder {
    const fcsl_run_t *run;
    const fcsl_machine_t *machine;
    fcsl_bag_t *bag;
    int lossless;
    int stepped;
    uint32_t topic_count; /* with added topics; 0 while there are none */
    uint64_t dropped;
    uint8_t *scratch; /* one message being built */
    size_t scratch_size;
    /* What the last messages on change said; meaningless until `stepped`. */
    uint8_t *health;
    uint64_t *faults;
    uint64_t *overruns;

    fcsl_ring_t ring;
    pthread_t writer;
    fcsl_error_t failure; /* written once, before `failed` is set */
    atomic_int failed;
};

/* Hands one message to the writer; one that does not fit is counted as dropped. */
void fcsl_recorder_push(fcsl_recorder_t *recorder, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, size_t size);
/* Records the whole machine struct as it is now. */
void fcsl_recorder_checkpoint(fcsl_recorder_t *recorder);

#endif /* FCSL_RECORDER_INTERNAL_H */
