/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_RECORDER_INTERNAL_H
#define FCSL_RECORDER_INTERNAL_H

#include <pthread.h>
#include <stdatomic.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_bag.h"
#include "messages/tick_messages.h"
#include "messages/verdict_message.h"
#include "ring.h"
#include "record_topics.h"

typedef struct fcsl_recorder fcsl_recorder_t;

/* Topic numbers in the bag: fixed ones, then what is shown of every tick, then events and verdicts if the machine has any, then
 * added ones. */
enum {
    FCSL_TOPIC_STATE = 0,
    FCSL_TOPIC_TRANSITIONS = 1,
    FCSL_TOPIC_HEALTH = 2,
    FCSL_TOPIC_FAULTS = 3,
    FCSL_TOPIC_CHECKPOINT = 4,
    FCSL_TOPIC_WRITES = 5,
    FCSL_TOPIC_VIEWS = 6,
    FCSL_TOPIC_FIRST_SHOWN = 7,
};

/* Kinds of records in the ring. */
enum {
    FCSL_RECORD_TICK,       /* the recorded ranges of the machine struct, one after another */
    FCSL_RECORD_WRITE,      /* fcsl_write_t (its `data` means nothing), then the data */
    FCSL_RECORD_FORCED,     /* two of const fcsl_state_t *: from, to */
    FCSL_RECORD_CHECKPOINT, /* the machine struct, the monitor's struct */
    FCSL_RECORD_VERDICTS,   /* as verdict_message.h has it */
    FCSL_RECORD_EVENTS,     /* fcsl_told_event_t, one after another */
    FCSL_RECORD_MESSAGE     /* + topic: a message as it is, at the record's time */
};

struct fcsl_recorder {
    const fcsl_machine_t *machine;
    const uint8_t *live; /* the machine struct of the run */
    fcsl_verdict_table_t verdicts;
    const uint8_t *remembered; /* the monitor's struct of the run */

    /* The thread that owns the run; the writer sees those that do not change. What a tick reads lies together. */
    _Atomic uint64_t ring_full;
    uint32_t topic_count; /* with added topics; 0 while there are none */
    int stepped;
    fcsl_ring_policy_t write_policy; /* of host writes, without which the run cannot be reproduced */
    fcsl_ring_policy_t tick_policy;
    uint64_t keyframe_ticks; /* from one keyframe to the next */
    uint64_t keyframe_age;   /* ticks since the last one */
    _Atomic uint64_t keyframes_dropped;
    uint32_t lost_writes;     /* host writes that found no room, of which the ring does not tell yet */
    fcsl_stamp_t first_lost; /* the first of them */
    fcsl_range_t *ranges; /* of the machine struct, recorded every tick */
    uint32_t range_count;
    uint32_t range_bytes;
    fcsl_ring_t ring;

    /* The writer. */
    pthread_t writer;
    fcsl_bag_t *bag;
    fcsl_record_topic_t *shown;
    uint32_t shown_count;
    uint32_t own_topics; /* all but added ones; the last of them is that of verdicts, if there is a monitor */
    /* How the bag is split, and what is kept of it: recorder_files.c. */
    uint64_t split_bytes;
    uint64_t split_ns;
    uint32_t keep_files;
    uint64_t around_ns;
    uint64_t keep_until_ns; /* behind a trigger */
    uint8_t *views;         /* the message of its topic, for every file */
    uint32_t views_size;    /* 0: none */
    uint8_t *verdicts_seen; /* the rows that came last */
    int has_verdicts;
    uint8_t *data;    /* a machine struct of which the recorded ranges are those of the tick being written */
    uint8_t *scratch; /* one message being built */
    size_t scratch_size;
    /* What the last messages on change said; meaningless until `status_seen`. Every file begins with them. */
    int status_seen;
    int status_written;
    uint8_t *health;
    uint64_t *faults;
    uint64_t *overruns;
    uint32_t *fault_places;
    fcsl_error_t failure; /* written once, before `failed` is set */
    atomic_int failed;
    _Atomic uint64_t disk_failed;
};

/* Works out what a tick copies: what the shown messages and those on change need. 0, or -1. */
int fcsl_recorder_choose_ranges(fcsl_recorder_t *recorder, fcsl_error_t *error);
/* How many ticks pass between two keyframes. */
void fcsl_recorder_choose_keyframes(fcsl_recorder_t *recorder);
/* Records the whole machine struct as it is now, and that of the monitor; 0, or -1 without room for `policy`. */
int fcsl_recorder_checkpoint(fcsl_recorder_t *recorder, fcsl_stamp_t stamp, fcsl_ring_policy_t policy);
/* Room for a record, behind word of host writes that were lost before it; null when there is none. */
uint8_t *fcsl_recorder_claim(fcsl_recorder_t *recorder, const fcsl_record_t *record, fcsl_ring_policy_t policy);
/* Reads fcsl_record_options_t.split. 0, or -1. */
int fcsl_recorder_read_split(fcsl_recorder_t *recorder, const char *split, fcsl_error_t *error);
/* The writer: a keyframe comes, with which a file may begin. 0, or -1 with the reason in `failure`. */
int fcsl_recorder_split(fcsl_recorder_t *recorder, fcsl_stamp_t stamp);
/* The writer: something happened around which the recording is kept. */
void fcsl_recorder_trigger(fcsl_recorder_t *recorder, uint64_t time_ns);
/* The writer thread: makes messages of the records of the ring until it ends. */
void *fcsl_recorder_run_writer(void *recorder);

#endif /* FCSL_RECORDER_INTERNAL_H */
