/* SPDX-License-Identifier: Apache-2.0
 *
 * The recorder's life: topics, the ring and its writer thread, errors. What is copied in a tick: recorder_tick.c; what is made of it: recorder_writer.c.
 */
#define _GNU_SOURCE
#include "recorder.h"

#include <ctype.h>
#include <inttypes.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>

#include "fcsl/fcsl_tick_time.h"
#include "machine/fault_place.h"
#include "machine/machine_struct.h"
#include "machine/monitor_memory.h"
#include "messages/event_message.h"
#include "messages/schema.h"
#include "recorder_internal.h"

enum {
    TOPIC_BYTES = 1024,
    SCHEMA_BYTES_MAX = 1 << 20,
    RING_BYTES_MIN = 8 << 20,
    SCRATCH_BASE_BYTES = 4096,
    VIEWS_HEAD_BYTES = 64
};

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
    } topics[FCSL_TOPIC_FIRST_SHOWN] = {
        [FCSL_TOPIC_STATE] = {"state", "fcsl_msgs/msg/MachineState", FCSL_SCHEMA_MACHINE_STATE, 1},
        [FCSL_TOPIC_TRANSITIONS] = {"transitions", "fcsl_msgs/msg/TransitionEvent", FCSL_SCHEMA_TRANSITION_EVENT, 0},
        [FCSL_TOPIC_HEALTH] = {"health", "fcsl_msgs/msg/InstanceHealth", FCSL_SCHEMA_INSTANCE_HEALTH, 0},
        [FCSL_TOPIC_FAULTS] = {"faults", "fcsl_msgs/msg/FaultCounters", FCSL_SCHEMA_FAULT_COUNTERS, 0},
        [FCSL_TOPIC_CHECKPOINT] = {"record/checkpoint", "fcsl_msgs/msg/Checkpoint", FCSL_SCHEMA_CHECKPOINT, 0},
        [FCSL_TOPIC_WRITES] = {"record/writes", "fcsl_msgs/msg/HostWrite", FCSL_SCHEMA_HOST_WRITE, 0},
        [FCSL_TOPIC_VIEWS] = {"record/views", "std_msgs/msg/String", FCSL_SCHEMA_STRING, 1},
    };
    char topic[TOPIC_BYTES];
    for (uint32_t i = 0; i < FCSL_TOPIC_FIRST_SHOWN; i++) {
        topic_name(recorder->machine, name_space, topics[i].rest, topic);
        if (fcsl_bag_add_topic(recorder->bag, topic, topics[i].type, topics[i].schema, topics[i].transient_local,
                               error) != (int)i) {
            return -1;
        }
    }
    return 0;
}

static int add_shown_topics(fcsl_recorder_t *recorder, const char *name_space, fcsl_error_t *error)
{
    char topic[TOPIC_BYTES];
    for (uint32_t i = 0; i < recorder->shown_count; i++) {
        const fcsl_record_topic_t *shown = &recorder->shown[i];
        if (strlen(shown->schema) > SCHEMA_BYTES_MAX) {
            return fcsl_fail(error, "the definition of message '%.256s' is too long", shown->type);
        }
        topic_name(recorder->machine, name_space, shown->topic, topic);
        if (fcsl_bag_add_topic(recorder->bag, topic, shown->type, shown->schema, 0, error) < 0) {
            return -1;
        }
    }
    return 0;
}

static int add_event_topic(fcsl_recorder_t *recorder, const char *name_space, fcsl_error_t *error)
{
    char topic[TOPIC_BYTES];
    recorder->own_topics = FCSL_TOPIC_FIRST_SHOWN + recorder->shown_count;
    if (recorder->machine->event_site_count == 0) {
        return 0;
    }
    recorder->own_topics++;
    topic_name(recorder->machine, name_space, "events", topic);
    return fcsl_bag_add_topic(recorder->bag, topic, "fcsl_msgs/msg/Event", FCSL_SCHEMA_EVENT, 0, error) < 0 ? -1 : 0;
}

static int add_verdict_topic(fcsl_recorder_t *recorder, const char *name_space, fcsl_error_t *error)
{
    char topic[TOPIC_BYTES];
    if (recorder->verdicts.monitor == NULL) {
        return 0;
    }
    recorder->own_topics++;
    topic_name(recorder->machine, name_space, "requirements", topic);
    return fcsl_bag_add_topic(recorder->bag, topic, "fcsl_msgs/msg/RequirementVerdicts",
                              FCSL_SCHEMA_REQUIREMENT_VERDICTS, 0, error) < 0
               ? -1
               : 0;
}

/* Room for the largest message the recorder itself writes. */
static size_t scratch_bytes(const fcsl_recorder_t *recorder, const char *views)
{
    const fcsl_machine_t *machine = recorder->machine;
    const size_t fault_bytes = fcsl_fault_text_bytes(machine);
    size_t bytes =
        SCRATCH_BASE_BYTES + machine->size + fcsl_monitor_memory_bytes(recorder->verdicts.monitor) + strlen(views);
    size_t largest = 0;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        bytes += strlen(machine->instances[i].name) + fault_bytes + 40u;
    }
    for (uint32_t i = 0; i < recorder->shown_count; i++) {
        const uint32_t size = recorder->shown[i].layout.size;
        largest = size > largest ? size : largest;
    }
    return bytes + largest + fcsl_event_message_capacity(machine) + fcsl_verdict_message_capacity(&recorder->verdicts);
}

static int allocate(fcsl_recorder_t *recorder, const char *views, fcsl_error_t *error)
{
    const uint32_t count = recorder->machine->instance_count;
    recorder->scratch_size = scratch_bytes(recorder, views);
    recorder->scratch = malloc(recorder->scratch_size);
    recorder->verdicts_seen =
        calloc(1, recorder->verdicts.monitor != NULL ? fcsl_verdict_rows_bytes(&recorder->verdicts) : 1u);
    recorder->data = calloc(1, fcsl_run_data_bytes(recorder->machine));
    recorder->health = calloc(count + 1u, sizeof *recorder->health);
    recorder->faults = calloc(count + 1u, sizeof *recorder->faults);
    recorder->overruns = calloc(count + 1u, sizeof *recorder->overruns);
    recorder->fault_places = calloc(count + 1u, sizeof *recorder->fault_places);
    if (recorder->scratch == NULL || recorder->verdicts_seen == NULL || recorder->data == NULL ||
        recorder->health == NULL || recorder->faults == NULL || recorder->overruns == NULL ||
        recorder->fault_places == NULL) {
        return fcsl_fail(error, "out of memory for the recorder");
    }
    return 0;
}

static void free_recorder(fcsl_recorder_t *recorder)
{
    fcsl_record_topics_free(recorder->shown, recorder->shown_count);
    free(recorder->ranges);
    free(recorder->scratch);
    free(recorder->views);
    free(recorder->verdicts_seen);
    free(recorder->data);
    free(recorder->health);
    free(recorder->faults);
    free(recorder->overruns);
    free(recorder->fault_places);
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
    const int code = pthread_create(&recorder->writer, NULL, fcsl_recorder_run_writer, recorder);
    (void)pthread_sigmask(SIG_SETMASK, &before, NULL);
    if (code != 0) {
        fcsl_ring_free(&recorder->ring);
        return fcsl_fail(error, "cannot start the recorder's thread: %s", strerror(code));
    }
    return 0;
}

/* The one message of its topic in each file, here before the writer thread begins; none where there is nothing to say. */
static int put_views(fcsl_recorder_t *recorder, const char *views, uint64_t time_ns, fcsl_error_t *error)
{
    if (views[0] == '\0') {
        return 0;
    }
    const size_t capacity = strlen(views) + VIEWS_HEAD_BYTES;
    recorder->views = malloc(capacity);
    if (recorder->views == NULL) {
        return fcsl_fail(error, "out of memory for the recorder");
    }
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, recorder->views, capacity);
    fcsl_cdr_string(&cdr, views);
    recorder->views_size = (uint32_t)fcsl_cdr_end(&cdr);
    fcsl_bag_lock(recorder->bag);
    const int status =
        fcsl_bag_write(recorder->bag, FCSL_TOPIC_VIEWS, time_ns, recorder->views, recorder->views_size, error);
    fcsl_bag_unlock(recorder->bag);
    return status;
}

static int prepare(fcsl_recorder_t *recorder, const fcsl_record_start_t *start, const fcsl_record_options_t *options,
                   const char *name_space, fcsl_error_t *error)
{
    const fcsl_stamp_t first = start->first;
    const uint64_t start_ns =
        first.time_ns == FCSL_TICK_TIME ? fcsl_tick_time_ns(start->machine->tick_hz, first.tick) : first.time_ns;
    recorder->bag = fcsl_bag_open(options->bag, start_ns, error);
    if (recorder->bag == NULL) {
        return -1;
    }
    if (add_fixed_topics(recorder, name_space, error) != 0 || add_shown_topics(recorder, name_space, error) != 0 ||
        add_event_topic(recorder, name_space, error) != 0 || add_verdict_topic(recorder, name_space, error) != 0 ||
        fcsl_bag_publish(recorder->bag, error) != 0 || put_views(recorder, start->views, start_ns, error) != 0 ||
        start_writer(recorder, error) != 0) {
        fcsl_bag_abandon(recorder->bag);
        return -1;
    }
    return 0;
}

fcsl_recorder_t *fcsl_recorder_open(const fcsl_record_start_t *start, const fcsl_record_options_t *options,
                                    fcsl_error_t *error)
{
    const char *name_space = options->name_space != NULL ? options->name_space : "";
    const char *fields = options->fields != NULL ? options->fields : FCSL_RECORD_FIELDS;
    if (options->bag == NULL || !is_namespace(name_space)) {
        (void)fcsl_fail(error, options->bag == NULL ? "no bag given" : "'%s' is not a ROS namespace", name_space);
        return NULL;
    }
    fcsl_recorder_t *recorder = calloc(1, sizeof *recorder);
    if (recorder == NULL) {
        (void)fcsl_fail(error, "out of memory for the recorder");
        return NULL;
    }
    recorder->machine = start->machine;
    recorder->live = start->data;
    recorder->verdicts = start->verdicts;
    recorder->remembered = start->remembered;
    fcsl_recorder_set_lossless(recorder, options->lossless);
    if (fcsl_recorder_read_split(recorder, options->split != NULL ? options->split : "", error) != 0 ||
        fcsl_record_topics_build(start->machine, fields, &recorder->shown, &recorder->shown_count, error) != 0 ||
        fcsl_recorder_choose_ranges(recorder, error) != 0 || allocate(recorder, start->views, error) != 0 ||
        prepare(recorder, start, options, name_space, error) != 0) {
        free_recorder(recorder);
        return NULL;
    }
    fcsl_recorder_choose_keyframes(recorder);
    (void)fcsl_recorder_checkpoint(recorder, start->first,
                                   recorder->write_policy); /* the ring is empty: there is room */
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

void fcsl_recorder_set_lossless(fcsl_recorder_t *recorder, int lossless)
{
    recorder->write_policy = lossless ? FCSL_RING_WAIT : FCSL_RING_DROP;
    recorder->tick_policy = lossless ? FCSL_RING_WAIT : FCSL_RING_DROP_EARLIER;
}

fcsl_record_drops_t fcsl_recorder_drops(const fcsl_recorder_t *recorder)
{
    return (fcsl_record_drops_t){
        .ring_full = atomic_load_explicit(&recorder->ring_full, memory_order_relaxed),
        .disk_failed = atomic_load_explicit(&recorder->disk_failed, memory_order_relaxed),
        .keyframes = atomic_load_explicit(&recorder->keyframes_dropped, memory_order_relaxed),
    };
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
