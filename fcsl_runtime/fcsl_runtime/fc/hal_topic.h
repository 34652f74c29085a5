/* SPDX-License-Identifier: Apache-2.0
 *
 * What the HAL knows of itself, in the bag: a topic of its own beside those of the machine, and no part of a run's digest.
 */
#ifndef FC_HAL_TOPIC_H
#define FC_HAL_TOPIC_H

#include "fcsl/fcsl_hal.h"
#include "fcsl/fcsl_run.h"

typedef struct {
    int number; /* of the topic */
    uint8_t *cdr; /* null: nothing is recorded */
    size_t size;
} hal_topic_t;

/* Before the first step of a run that is recorded. A HAL without counters gets no topic. 0, or -1 with `error`. */
int hal_topic_open(hal_topic_t *topic, const fcsl_hal_t *hal, fcsl_run_t *run, const char *name_space,
                   fcsl_error_t *error);
/* The counters of the tick that has been completed last. What does not fit into the recorder is counted there. */
void hal_topic_write(const hal_topic_t *topic, const fcsl_hal_t *hal, fcsl_run_t *run);
void hal_topic_close(hal_topic_t *topic);

#endif /* FC_HAL_TOPIC_H */
