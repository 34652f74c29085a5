/* SPDX-License-Identifier: Apache-2.0
 *
 * Turns what happens in a run into messages of its bag. All functions belong to the thread that owns the run: they copy what
 * happened into a ring. A thread of the recorder's own makes the messages of it and writes them to disk.
 */
#ifndef FCSL_RECORDER_H
#define FCSL_RECORDER_H

#include "fcsl/fcsl_error.h"
#include "messages/record_messages.h"
#include "messages/verdict_message.h"

typedef struct fcsl_recorder fcsl_recorder_t;

/* What is recorded, from which tick on. */
typedef struct {
    const fcsl_machine_t *machine;
    const uint8_t *data; /* the machine struct; it stays where it is */
    const char *views;
    fcsl_verdict_table_t verdicts;
    const uint8_t *remembered; /* the struct of their monitor; it stays where it is */
    fcsl_stamp_t first; /* of the initial checkpoint */
} fcsl_record_start_t;

/* Opens the bag and records the initial checkpoint; null with `error` filled. */
fcsl_recorder_t *fcsl_recorder_open(const fcsl_record_start_t *start, const fcsl_record_options_t *options,
                                    fcsl_error_t *error);
/* Flushes, writes metadata.yaml, frees; 0, or -1 when something of the record is missing on disk. */
int fcsl_recorder_close(fcsl_recorder_t *recorder, fcsl_error_t *error);

/* -1 with the reason once writing has failed. */
int fcsl_recorder_check(const fcsl_recorder_t *recorder, fcsl_error_t *error);
/* What comes from here on waits for the writer, or is left out when there is no room. */
void fcsl_recorder_set_lossless(fcsl_recorder_t *recorder, int lossless);
fcsl_record_drops_t fcsl_recorder_drops(const fcsl_recorder_t *recorder);

/* Of the tick that is the first to see it, as below. */
void fcsl_recorder_write(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_write_t *write);
/* A change of state that the host forced. */
void fcsl_recorder_forced(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_state_t *from,
                          const fcsl_state_t *to);
/* Whether a tick may begin: a lossless recording ends with its writing. Fetches where its record will go. */
int fcsl_recorder_begin_tick(fcsl_recorder_t *recorder, fcsl_error_t *error);
/* Everything that the tick just completed has to show. */
void fcsl_recorder_tick(fcsl_recorder_t *recorder, fcsl_stamp_t stamp);
/* What follows those: a keyframe, where one is due. It is a checkpoint from which a replay can begin: recorder_keyframe.c.
 * `next`: the tick that comes now. */
void fcsl_recorder_end_tick(fcsl_recorder_t *recorder, fcsl_stamp_t next);
/* The verdicts after the tick just completed: fcsl_verdict_rows_bytes. 0, or -1: there was no room. */
int fcsl_recorder_verdicts(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const uint8_t *rows);

/* Events that the tick just completed has told. */
void fcsl_recorder_events(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, const fcsl_told_event_t *events,
                          uint32_t count);

int fcsl_recorder_add_topic(fcsl_recorder_t *recorder, const char *topic, const char *type, const char *schema,
                            fcsl_error_t *error);
int fcsl_recorder_message(fcsl_recorder_t *recorder, int topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                          fcsl_error_t *error);

#endif /* FCSL_RECORDER_H */
