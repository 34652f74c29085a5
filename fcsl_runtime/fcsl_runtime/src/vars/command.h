/* SPDX-License-Identifier: Apache-2.0
 *
 * A command, and the one slot through which it reaches the step thread. The step thread takes no lock; between ticks it reads a
 * word, executes, and wakes the server, which never waits for it: there is at most one command under way.
 *
 * `phase` says to whom the command belongs: SLOT_FREE, and again once SLOT_DONE, to the server; SLOT_POSTED to the step thread. Only the owner
 * touches it, and gives it away by storing the next phase with release; the other one loads that with acquire before it reads the
 * command. So its bytes need no atomic operations. A second server thread, or a second step thread, breaks it.
 */
#ifndef FCSL_VARS_COMMAND_H
#define FCSL_VARS_COMMAND_H

#include <semaphore.h>
#include <stdatomic.h>

#include "fcsl/fcsl_vars.h"
#include "limits.h"

typedef enum {
    COMMAND_SET,
    COMMAND_PAUSE,
    COMMAND_RESUME,
    COMMAND_TICK,
    COMMAND_SET_STATE,
    COMMAND_SAVE,
    COMMAND_RESTORE,
    COMMAND_INJECT,
    COMMAND_ATTACH,
    COMMAND_SAMPLE,
    COMMAND_RECORD,
    COMMAND_STOP_RECORDING,
    COMMAND_HARDWARE,
} command_kind_t;

/* What the next execute of an instance counts as. */
typedef enum { INJECT_FAULT, INJECT_OVERRUN, INJECT_DEGRADED, INJECT_FAILED } injection_t;

/* Contiguous scalars of one field. */
typedef struct {
    uint32_t block;
    uint32_t field;
    uint32_t element;
    uint32_t size;
    size_t at; /* in `bytes` */
} write_t;

typedef struct {
    command_kind_t kind;
    uint32_t block;
    uint64_t count; /* ticks; what hardware refused so far */
    int32_t state;
    uint32_t index; /* instance or channel; pin, channel or address of the hardware's bank */
    uint32_t bank;  /* of hardware (command_hardware.c) */
    int put;        /* a value into it */
    injection_t injection;
    uint32_t size; /* bytes of a sample, or of what is restored */
    uint32_t age_ticks;
    int64_t stamp_ns;
    uint32_t write_count;
    write_t *writes; /* WRITES_MAX */
    /* Values of the writes, what is restored, a sample, or a bag's path and name space, each with its 0. */
    uint8_t *bytes;
    fcsl_hw_sim_t *hardware; /* of save and restore */
    char file[FILE_BYTES]; /* of save, in the folder of checkpoints; "" for none */

    fcsl_vars_status_t status;
    fcsl_error_t error;
    uint64_t published; /* of the history, when the command was done: the last of them shows what it did */
} command_t;

typedef struct {
    command_t command;
    atomic_int phase;
    sem_t arrived;
} slot_t;

/* `bytes`: room for the values of a command. */
int fcsl_slot_open(slot_t *slot, size_t bytes);
void fcsl_slot_free(slot_t *slot);

/* Server: whether a command may be prepared; hands it over; whether it is done (and then takes the slot back). */
int fcsl_slot_is_free(const slot_t *slot);
void fcsl_slot_post(slot_t *slot);
int fcsl_slot_take_back(slot_t *slot);

/* Step thread: the waiting command, or null. Every command taken must be answered. */
command_t *fcsl_slot_take(slot_t *slot);
void fcsl_slot_finish(slot_t *slot);
/* Step thread: sleeps until a command arrives, but at most until `deadline_ns` of the monotonic clock. */
void fcsl_slot_wait(slot_t *slot, uint64_t deadline_ns);
/* Any thread: ends that sleep. */
void fcsl_slot_wake(slot_t *slot);

#endif /* FCSL_VARS_COMMAND_H */
