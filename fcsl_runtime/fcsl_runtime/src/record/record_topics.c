/* SPDX-License-Identifier: Apache-2.0
 *
 * Which fields a record shows, under which topics.
 */
#define _GNU_SOURCE
#include "record_topics.h"

#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/path_glob.h"
#include "messages/field_message.h"
#include "messages/schema.h"

/* Where a kind of fields goes; outputs first, as they have always been. */
typedef struct {
    fcsl_role_t role;
    const char *topic; /* behind the instance's name */
    const char *type;  /* what is added to the name of the instance's interface */
} group_t;

static const group_t GROUPS[] = {
    {FCSL_ROLE_OUTPUT, "", "Outputs"},
    {FCSL_ROLE_INPUT, "/inputs", "Inputs"},
    {FCSL_ROLE_PARAMETER, "/parameters", "Parameters"},
    {FCSL_ROLE_STATE, "/state", "State"},
};
enum { GROUP_COUNT = sizeof GROUPS / sizeof GROUPS[0] };

static const char *path_of(const void *table, uint32_t number)
{
    return ((const fcsl_machine_t *)table)->fields[number].path;
}

/* A machine without inputs is recorded by default like any other. */
static int choose(const fcsl_machine_t *machine, const char *globs, uint8_t *chosen, fcsl_error_t *error)
{
    const fcsl_paths_t paths = {.table = machine, .count = machine->field_count, .path = path_of};
    return fcsl_match_paths(globs, strcmp(globs, FCSL_RECORD_FIELDS) == 0, &paths, chosen, error);
}

/* What all messages of one machine are made with. */
typedef struct {
    const fcsl_machine_t *machine;
    const uint8_t *chosen;
    const fcsl_field_t **leaves; /* room for all fields */
    fcsl_record_topic_t *shown;
    uint32_t count;
    fcsl_error_t *error;
} builder_t;

/* Gathers the chosen fields of `role` and `instance` (FCSL_NONE: of any); *all says whether there are no others. */
static uint32_t gather(const builder_t *b, fcsl_role_t role, int32_t instance, int *all)
{
    uint32_t count = 0;
    *all = 1;
    for (uint32_t i = 0; i < b->machine->field_count; i++) {
        const fcsl_field_t *field = &b->machine->fields[i];
        if (field->role == role && (instance == FCSL_NONE || field->instance == instance)) {
            *all = *all && b->chosen[i];
            if (b->chosen[i]) {
                b->leaves[count++] = field;
            }
        }
    }
    return count;
}

/* The outputs of an instance, all of them: its own interface, as ROS 2 knows it. */
static int add_interface(builder_t *b, const fcsl_instance_t *instance)
{
    fcsl_record_topic_t *shown = &b->shown[b->count++];
    shown->topic = fcsl_interface_topic(instance);
    shown->type = strdup(instance->message_type);
    shown->schema = fcsl_interface_schema(instance);
    if (shown->topic == NULL || shown->type == NULL || shown->schema == NULL) {
        return fcsl_fail(b->error, "out of memory for messages");
    }
    return fcsl_layout_build(b->machine, instance, &shown->layout, b->error);
}

/* Some fields, `count` of them in b->leaves: an interface made for this record. */
static int add_fields(builder_t *b, uint32_t count, char *topic, char *type)
{
    fcsl_record_topic_t *shown = &b->shown[b->count++];
    shown->topic = topic;
    shown->type = type;
    if (topic == NULL || type == NULL) {
        return fcsl_fail(b->error, "out of memory for messages");
    }
    return fcsl_field_message_build(b->machine, b->leaves, count, type, &shown->schema, &shown->layout, b->error);
}

/* asprintf without the case that it fails and leaves anything behind. */
__attribute__((format(printf, 1, 2))) static char *text_of(const char *format, ...)
{
    char *text = NULL;
    va_list arguments;
    va_start(arguments, format);
    const int length = vasprintf(&text, format, arguments);
    va_end(arguments);
    return length < 0 ? NULL : text;
}

static int add_instance(builder_t *b, uint32_t index)
{
    const fcsl_instance_t *instance = &b->machine->instances[index];
    const int package = (int)strcspn(instance->message_type, "/");
    const char *name = strrchr(instance->message_type, '/');
    char *topic = fcsl_interface_topic(instance);
    int failed = topic == NULL ? fcsl_fail(b->error, "out of memory for messages") : 0;
    for (int i = 0; i < GROUP_COUNT && failed == 0; i++) {
        const group_t *group = &GROUPS[i];
        int all = 0;
        const uint32_t count = gather(b, group->role, (int32_t)index, &all);
        if (count == 0) {
            continue;
        }
        if (group->role == FCSL_ROLE_OUTPUT && all) {
            failed = add_interface(b, instance);
        } else {
            failed = add_fields(b, count, text_of("%s%s", topic, group->topic),
                                text_of("%.*s_fields/msg/%s%s", package, instance->message_type,
                                        name != NULL ? name + 1 : "", group->type));
        }
    }
    free(topic);
    return failed;
}

static int by_path(const void *a, const void *b)
{
    return strcmp((*(const fcsl_field_t *const *)a)->path, (*(const fcsl_field_t *const *)b)->path);
}

/* What is known of all channels. The table has each channel's stamp behind everything else: sorted, a channel is one struct. */
static int add_channels(builder_t *b)
{
    int all = 0;
    const uint32_t count = gather(b, FCSL_ROLE_CHANNEL, FCSL_NONE, &all);
    if (count == 0) {
        return 0;
    }
    qsort((void *)b->leaves, count, sizeof *b->leaves, by_path);
    return add_fields(b, count, strdup("record/channels"), text_of("%s_fields/msg/Channels", b->machine->name));
}

static int build(builder_t *b)
{
    for (uint32_t i = 0; i < b->machine->instance_count; i++) {
        if (add_instance(b, i) != 0) {
            return -1;
        }
    }
    return add_channels(b);
}

static int begin_messages(builder_t *b)
{
    for (uint32_t i = 0; i < b->count; i++) {
        fcsl_record_topic_t *shown = &b->shown[i];
        shown->message = malloc(shown->layout.size);
        if (shown->message == NULL) {
            return fcsl_fail(b->error, "out of memory for messages");
        }
        fcsl_layout_begin(&shown->layout, shown->message);
    }
    return 0;
}

int fcsl_record_topics_build(const fcsl_machine_t *machine, const char *globs, fcsl_record_topic_t **shown,
                             uint32_t *count, fcsl_error_t *error)
{
    uint8_t *chosen = calloc(machine->field_count + 1u, 1);
    builder_t b = {.machine = machine, .chosen = chosen, .error = error};
    b.leaves = malloc((machine->field_count + 1u) * sizeof *b.leaves);
    b.shown = calloc(machine->instance_count * (size_t)GROUP_COUNT + 1u, sizeof *b.shown);
    int status = -1;
    if (chosen == NULL || b.leaves == NULL || b.shown == NULL) {
        (void)fcsl_fail(error, "out of memory for messages");
    } else if (choose(machine, globs, chosen, error) == 0) {
        status = build(&b);
    }
    if (status == 0) {
        status = begin_messages(&b);
    }
    free(chosen);
    free((void *)b.leaves);
    *shown = b.shown;
    *count = b.count;
    return status;
}

void fcsl_record_topics_free(fcsl_record_topic_t *shown, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        free(shown[i].topic);
        free(shown[i].type);
        free(shown[i].schema);
        free(shown[i].message);
        fcsl_layout_free(&shown[i].layout);
    }
    free(shown);
}
