/* SPDX-License-Identifier: Apache-2.0
 *
 * The HAL's counters as ROS 2 messages of a bag.
 */
#include "hal_topic.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_cdr.h"

enum { NAME_BYTES = 512, LINE_BYTES = 384 };
static const char TYPE[] = "fcsl_hal/msg/Counters";

static int is_counter(const fcsl_field_t *field)
{
    return field->type == FCSL_U64 && field->count == 1u;
}

/* Header, tick, and a number for each counter: link.port0.sent is link_port0_sent. Null without memory. */
static char *make_schema(const fcsl_hal_t *hal)
{
    const size_t capacity = (hal->field_count + 2u) * LINE_BYTES + sizeof FCSL_SCHEMA_HEADER;
    char *text = malloc(capacity);
    if (text == NULL) {
        return NULL;
    }
    size_t at = (size_t)snprintf(text, capacity, "std_msgs/Header header\nuint64 tick\n");
    for (uint32_t i = 0; i < hal->field_count; i++) {
        const fcsl_field_t *field = &hal->fields[i];
        char line[LINE_BYTES];
        if (!is_counter(field)) {
            continue;
        }
        (void)snprintf(line, sizeof line, "uint64 %.240s  # %.110s\n", field->path, field->doc);
        for (char *c = line; *c != '#'; c++) {
            *c = *c == '.' ? '_' : *c;
        }
        at += (size_t)snprintf(text + at, capacity - at, "%s", line);
    }
    (void)snprintf(text + at, capacity - at, FCSL_SCHEMA_HEADER);
    return text;
}

static size_t compose(const hal_topic_t *topic, const fcsl_hal_t *hal, const fcsl_run_t *run, uint64_t tick)
{
    fcsl_cdr_t cdr;
    fcsl_cdr_begin(&cdr, topic->cdr, topic->size);
    fcsl_cdr_header(&cdr, fcsl_run_tick_time_ns(run, tick));
    fcsl_cdr_u64(&cdr, tick);
    for (uint32_t i = 0; i < hal->field_count; i++) {
        uint64_t value = 0;
        if (is_counter(&hal->fields[i])) {
            memcpy(&value, (const uint8_t *)hal->counters + hal->fields[i].offset, sizeof value);
            fcsl_cdr_u64(&cdr, value);
        }
    }
    return fcsl_cdr_end(&cdr);
}

int hal_topic_open(hal_topic_t *topic, const fcsl_hal_t *hal, fcsl_run_t *run, const char *name_space,
                   fcsl_error_t *error)
{
    char name[NAME_BYTES];
    if (hal->field_count == 0) {
        return 0;
    }
    const int bytes = snprintf(name, sizeof name, "%s%s/hal", name_space[0] != '\0' ? "/" : "", name_space);
    if (bytes < 0 || (size_t)bytes >= sizeof name) {
        return fcsl_fail(error, "the namespace is too long for the topic of the HAL");
    }
    char *schema = make_schema(hal);
    topic->size = 64u + sizeof(uint64_t) * (hal->field_count + 2u);
    topic->cdr = calloc(1, topic->size);
    if (schema == NULL || topic->cdr == NULL) {
        free(schema);
        return fcsl_fail(error, "out of memory for the topic of the HAL");
    }
    topic->number = fcsl_run_record_add_topic(run, name, TYPE, schema, error);
    free(schema);
    return topic->number < 0 ? -1 : 0;
}

void hal_topic_write(const hal_topic_t *topic, const fcsl_hal_t *hal, fcsl_run_t *run)
{
    fcsl_error_t error;
    if (topic->cdr != NULL) {
        const uint64_t tick = fcsl_run_tick(run) - 1u;
        const size_t size = compose(topic, hal, run, tick);
        (void)fcsl_run_record_write(run, topic->number, fcsl_run_tick_time_ns(run, tick), topic->cdr, (uint32_t)size,
                                    &error);
    }
}

void hal_topic_close(hal_topic_t *topic)
{
    free(topic->cdr);
    topic->cdr = NULL;
}
