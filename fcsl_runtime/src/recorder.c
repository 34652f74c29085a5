/* SPDX-License-Identifier: Apache-2.0
 *
 * The recorder's life: topics, the ring and its writer thread, errors. What goes into the messages is in telemetry.c.
 */
#define _GNU_SOURCE
#include "recorder_internal.h"

#include <ctype.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#include "schema.h"

enum { TOPIC_BYTES = 1024, SCHEMA_BYTES_MAX = 1 << 20, RING_BYTES_MIN = 8 << 20, SCRATCH_BASE_BYTES = 4096 };

static uint64_t now_s(void)
{
    struct timespec now = {0};
    (void)clock_gettime(CLOCK_MONOTONIC_COARSE, &now);
    return (uint64_t)now.tv_sec;
}

static void note_failure(fcsl_recorder_t *recorder, int status)
{
    if (status != 0) {
        atomic_store(&recorder->failed, 1);
    }
}

static void *run_writer(void *argument)
{
    fcsl_recorder_t *recorder = argument;
    fcsl_record_t record;
    const uint8_t *data = NULL;
    uint64_t flushed_s = 0; /* the first record, a checkpoint, is handed on at once */
    int unflushed = 0;
    fcsl_ring_status_t status = FCSL_RING_IDLE;
    while ((status = fcsl_ring_front(&recorder->ring, &record, &data)) != FCSL_RING_ENDED) {
        /* After a failure the ring is still emptied, so that nobody waits for room in vain. */
        const int works = !atomic_load(&recorder->failed);
        if (status == FCSL_RING_RECORD) {
            if (works) {
                note_failure(recorder, fcsl_bag_write(recorder->bag, record.topic, record.time_ns, data, record.size,
                                                      &recorder->failure));
                unflushed = 1;
            }
            fcsl_ring_pop(&recorder->ring);
        }
        if (works && unflushed && now_s() != flushed_s) {
            note_failure(recorder, fcsl_bag_flush(recorder->bag, &recorder->failure));
            flushed_s = now_s();
            unflushed = 0;
        }
    }
    return NULL;
}

static int is_namespace(const char *text)
{
    char before = '/';
    for (const char *at = text; *at != '\0'; at++) {
        if (!isalnum((unsigned char)*at) && *at != '_' && *at != '/') {
            return 0;
        }
        if (isdigit((unsigned char)*at) && before == '/') {
            return 0; /* ROS has no name that begins with a digit */
        }
        before = *at;
    }
    return strlen(text) < TOPIC_BYTES / 2 && strstr(text, "//") == NULL;
}

/* "/<ns>/<machine>/<rest>", whether the namespace was given with slashes around it or without. */
static void topic_name(const fcsl_machine_t *machine, const char *name_space, const char *rest, char *topic)
{
    while (*name_space == '/') {
        name_space++;
    }
    size_t length = strlen(name_space);
    while (length > 0 && name_space[length - 1] == '/') {
        length--;
    }
    (void)snprintf(topic, TOPIC_BYTES, "%s%.*s/%s/%s", length > 0 ? "/" : "", (int)length, name_space, machine->name,
                   rest);
}

static int add_fixed_topics(fcsl_recorder_t *recorder, const char *name_space, fcsl_error_t *error)
{
    static const struct {
        const char *rest;
        const char *type;
        const char *schema;
        int transient_local;
    } topics[FCSL_TOPIC_FIRST_INSTANCE] = {
        [FCSL_TOPIC_STATE] = {"state", "fcsl_msgs/msg/MachineState", FCSL_SCHEMA_MACHINE_STATE, 1},
        [FCSL_TOPIC_TRANSITIONS] = {"transitions", "fcsl_msgs/msg/TransitionEvent", FCSL_SCHEMA_TRANSITION_EVENT, 0},
        [FCSL_TOPIC_HEALTH] = {"health", "fcsl_msgs/msg/InstanceHealth", FCSL_SCHEMA_INSTANCE_HEALTH, 0},
        [FCSL_TOPIC_FAULTS] = {"faults", "fcsl_msgs/msg/FaultCounters", FCSL_SCHEMA_FAULT_COUNTERS, 0},
        [FCSL_TOPIC_CHECKPOINT] = {"record/checkpoint", "fcsl_msgs/msg/Checkpoint", FCSL_SCHEMA_CHECKPOINT, 0},
        [FCSL_TOPIC_WRITES] = {"record/writes", "fcsl_msgs/msg/HostWrite", FCSL_SCHEMA_HOST_WRITE, 0},
    };
    char topic[TOPIC_BYTES];
    for (uint32_t i = 0; i < FCSL_TOPIC_FIRST_INSTANCE; i++) {
        topic_name(recorder->machine, name_space, topics[i].rest, topic);
        if (fcsl_bag_add_topic(recorder->bag, topic, topics[i].type, topics[i].schema, topics[i].transient_local,
                               error) != (int)i) {
            return -1;
        }
    }
    return 0;
}

static int add_instance_topics(fcsl_recorder_t *recorder, const char *name_space, fcsl_error_t *error)
{
    char topic[TOPIC_BYTES];
    for (uint32_t i = 0; i < recorder->machine->instance_count; i++) {
        const fcsl_instance_t *instance = &recorder->machine->instances[i];
        const size_t capacity = strlen(instance->message_text) + sizeof FCSL_SCHEMA_HEADER + 1u;
        char *schema = capacity <= SCHEMA_BYTES_MAX ? malloc(capacity) : NULL;
        if (schema == NULL) {
            return fcsl_fail(error, "the message text of instance '%s' is too long", instance->name);
        }
        const size_t length = strlen(instance->message_text);
        const char *newline = length > 0 && instance->message_text[length - 1] == '\n' ? "" : "\n";
        (void)snprintf(schema, capacity, "%s%s" FCSL_SCHEMA_HEADER, instance->message_text, newline);
        topic_name(recorder->machine, name_space, instance->name, topic);
        const int index = fcsl_bag_add_topic(recorder->bag, topic, instance->message_type, schema, 0, error);
        free(schema);
        if (index < 0) {
            return -1;
        }
    }
    return 0;
}

/* Room for the largest message the recorder itself writes. */
static size_t scratch_bytes(const fcsl_run_t *run)
{
    const fcsl_machine_t *machine = run->machine;
    size_t bytes = SCRATCH_BASE_BYTES + machine->size;
    size_t largest = 0;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        bytes += strlen(machine->instances[i].name) + 32u;
        largest = run->layouts[i].size > largest ? run->layouts[i].size : largest;
    }
    return bytes + largest;
}

static int allocate(fcsl_recorder_t *recorder, const fcsl_run_t *run, fcsl_error_t *error)
{
    const uint32_t count = run->machine->instance_count;
    recorder->scratch_size = scratch_bytes(run);
    recorder->scratch = malloc(recorder->scratch_size);
    recorder->health = calloc(count + 1u, sizeof *recorder->health);
    recorder->faults = calloc(count + 1u, sizeof *recorder->faults);
    recorder->overruns = calloc(count + 1u, sizeof *recorder->overruns);
    if (recorder->scratch == NULL || recorder->health == NULL || recorder->faults == NULL ||
        recorder->overruns == NULL) {
        return fcsl_fail(error, "out of memory for the recorder");
    }
    return 0;
}

static void free_recorder(fcsl_recorder_t *recorder)
{
    free(recorder->scratch);
    free(recorder->health);
    free(recorder->faults);
    free(recorder->overruns);
    free(recorder);
}

static int start_writer(fcsl_recorder_t *recorder, fcsl_error_t *error)
{
    const size_t wanted = 8u * recorder->scratch_size;
    if (fcsl_ring_open(&recorder->ring, wanted > RING_BYTES_MIN ? wanted : RING_BYTES_MIN) != 0) {
        return fcsl_fail(error, "out of memory for the recorder's ring");
    }
    /* Signals belong to the program's own threads. */
    sigset_t all;
    sigset_t before;
    (void)sigfillset(&all);
    (void)pthread_sigmask(SIG_SETMASK, &all, &before);
    const int code = pthread_create(&recorder->writer, NULL, run_writer, recorder);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (code != 0) {
        fcsl_ring_free(&recorder->ring);
        return fcsl_fail(error, "cannot start the recorder's thread: %s", strerror(code));
    }
    return 0;
}

static int prepare(fcsl_recorder_t *recorder, const fcsl_run_t *run, const char *name_space, fcsl_error_t *error)
{
    return allocate(recorder, run, error) != 0 || add_fixed_topics(recorder, name_space, error) != 0 ||
                   add_instance_topics(recorder, name_space, error) != 0 ||
                   fcsl_bag_write_metadata(recorder->bag, error) != 0 || start_writer(recorder, error) != 0
               ? -1
               : 0;
}

fcsl_recorder_t *fcsl_recorder_open(const fcsl_run_t *run, const fcsl_record_options_t *options, fcsl_error_t *error)
{
    const char *name_space = options->name_space != NULL ? options->name_space : "";
    if (options->bag == NULL || !is_namespace(name_space)) {
        (void)fcsl_fail(error, options->bag == NULL ? "no bag given" : "'%s' is not a ROS namespace", name_space);
        return NULL;
    }
    fcsl_recorder_t *recorder = calloc(1, sizeof *recorder);
    if (recorder == NULL) {
        (void)fcsl_fail(error, "out of memory for the recorder");
        return NULL;
    }
    recorder->run = run;
    recorder->machine = run->machine;
    recorder->lossless = options->lossless;
    recorder->bag = fcsl_bag_open(options->bag, error);
    if (recorder->bag == NULL) {
        free_recorder(recorder);
        return NULL;
    }
    if (prepare(recorder, run, name_space, error) != 0) {
        fcsl_bag_abandon(recorder->bag);
        free_recorder(recorder);
        return NULL;
    }
    fcsl_recorder_checkpoint(recorder);
    return recorder;
}

int fcsl_recorder_close(fcsl_recorder_t *recorder, fcsl_error_t *error)
{
    fcsl_ring_end(&recorder->ring);
    (void)pthread_join(recorder->writer, NULL);
    fcsl_ring_free(&recorder->ring);
    int status = fcsl_recorder_check(recorder, error);
    if (fcsl_bag_close(recorder->bag, status == 0 ? error : NULL) != 0) {
        status = -1;
    }
    free_recorder(recorder);
    return status;
}

int fcsl_recorder_check(const fcsl_recorder_t *recorder, fcsl_error_t *error)
{
    if (!atomic_load(&recorder->failed)) {
        return 0;
    }
    return fcsl_fail(error, "recording failed: %.480s", recorder->failure.text);
}

uint64_t fcsl_recorder_dropped(const fcsl_recorder_t *recorder)
{
    return recorder->dropped;
}

void fcsl_recorder_push(fcsl_recorder_t *recorder, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, size_t size)
{
    const fcsl_record_t record = {.time_ns = time_ns, .size = (uint32_t)size, .topic = topic};
    if (size == 0 || fcsl_ring_push(&recorder->ring, &record, cdr, recorder->lossless) != 0) {
        recorder->dropped++;
    }
}

int fcsl_recorder_add_topic(fcsl_recorder_t *recorder, const char *topic, const char *type, const char *schema,
                            fcsl_error_t *error)
{
    if (recorder->stepped) {
        return fcsl_fail(error, "topic '%s' comes too late: topics are added before the first step", topic);
    }
    for (const char *at = topic; *at != '\0'; at++) {
        if (!isalnum((unsigned char)*at) && *at != '_' && *at != '/') {
            return fcsl_fail(error, "'%s' is not a topic name", topic);
        }
    }
    if (topic[0] != '/' || strlen(topic) >= TOPIC_BYTES || strlen(schema) > SCHEMA_BYTES_MAX) {
        return fcsl_fail(error, "topic '%.128s' must begin with '/' and be of sensible length", topic);
    }
    const int index = fcsl_bag_add_topic(recorder->bag, topic, type, schema, 0, error);
    if (index < 0 || fcsl_bag_write_metadata(recorder->bag, error) != 0) {
        return -1;
    }
    recorder->topic_count = (uint32_t)index + 1u;
    return index;
}

int fcsl_recorder_message(fcsl_recorder_t *recorder, int topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                          fcsl_error_t *error)
{
    const uint32_t first = FCSL_TOPIC_FIRST_INSTANCE + recorder->machine->instance_count;
    if (topic < (int)first || (uint32_t)topic >= recorder->topic_count) {
        return fcsl_fail(error, "topic number %d was not added to this recording", topic);
    }
    if (size == 0 || size > recorder->ring.capacity / 4) {
        return fcsl_fail(error, "a message of %" PRIu32 " bytes cannot be recorded", size);
    }
    if (fcsl_recorder_check(recorder, error) != 0) {
        return -1;
    }
    fcsl_recorder_push(recorder, (uint32_t)topic, time_ns, cdr, size);
    return 0;
}
