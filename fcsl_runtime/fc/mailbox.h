/* SPDX-License-Identifier: Apache-2.0
 *
 * Where a command meets the step thread: one slot, served between ticks. The step thread takes no lock; it looks at a flag,
 * acts, and posts a semaphore. The service thread waits for the answer, so there is never more than one command under way.
 */
#ifndef FC_MAILBOX_H
#define FC_MAILBOX_H

#include <semaphore.h>
#include <stdatomic.h>

#include "fcsl/fcsl_run.h"

typedef enum {
    COMMAND_NOTHING, /* only the answer's common part */
    COMMAND_GET,     /* copies one field into `bytes` */
    COMMAND_SAVE,    /* copies the whole struct into `bytes` */
    COMMAND_SET,
    COMMAND_PAUSE,
    COMMAND_RESUME,
    COMMAND_TICK,
    COMMAND_SET_STATE,
    COMMAND_RESTORE,
} command_kind_t;

typedef enum { COMMAND_OK, COMMAND_REFUSED, COMMAND_RUNNING, COMMAND_ENDED, COMMAND_FAILED } command_status_t;

/* What the loop counts; copied into every answer. */
typedef struct {
    uint64_t ticks;
    uint64_t late;           /* ticks begun more than a period after their time */
    uint64_t skipped;        /* times that the schedule was given up and begun anew */
    uint64_t faults;         /* of all instances */
    uint64_t overruns;       /* of all instances */
    uint64_t frames_refused; /* sensor frames */
    uint64_t hardware_failures;
    uint64_t records_dropped;
} counters_t;

typedef struct {
    command_kind_t kind;
    uint32_t field;
    uint32_t element;
    uint32_t size;
    uint64_t count; /* ticks */
    int32_t state;
    uint8_t *bytes; /* the machine's size */

    command_status_t status;
    fcsl_error_t error;
    uint64_t tick;
    int32_t current_state;
    int32_t next_state;
    int paused;
    counters_t counters;
} command_t;

typedef struct {
    command_t command;
    atomic_int pending;
    sem_t arrived;
    sem_t answered;
} mailbox_t;

int mailbox_open(mailbox_t *mailbox, const fcsl_machine_t *machine);
void mailbox_free(mailbox_t *mailbox);

/* Service thread: hands the command over and waits for the answer. */
void mailbox_call(mailbox_t *mailbox);

/* Step thread: the waiting command, or null. Every command taken must be answered. */
command_t *mailbox_take(mailbox_t *mailbox);
void mailbox_answer(mailbox_t *mailbox);
/* Step thread: sleeps until a command arrives, but at most until `deadline_ns` of the monotonic clock. */
void mailbox_wait(mailbox_t *mailbox, uint64_t deadline_ns);

#endif /* FC_MAILBOX_H */
