/* SPDX-License-Identifier: Apache-2.0
 *
 * Publishes the memory of machine and models to other threads.
 */
#include "publish.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_write_queue.h"
#include "fcsl/fcsl_error.h"

enum { HISTORY_SLOTS = 64, WRITER_BYTES = 256 };

/* The path of the value at this address: an output of an instance, or an actuator channel's field. */
static void name_source(const fcsl_sim_t *sim, const uint8_t *from, char *text)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[i];
        for (uint32_t f = 0; f < instance->model->field_count; f++) {
            const fcsl_field_t *field = &instance->model->fields[f];
            const uint8_t *begin = instance->data + field->offset;
            if (from >= begin && from < begin + field->size) {
                (void)snprintf(text, WRITER_BYTES, "%s.%s", instance->name, field->path);
                return;
            }
        }
    }
    for (uint32_t f = 0; f < sim->machine->field_count; f++) {
        const fcsl_field_t *field = &sim->machine->fields[f];
        const uint8_t *begin = sim->image + field->offset;
        if (from >= begin && from < begin + field->size) {
            (void)snprintf(text, WRITER_BYTES, "%s", field->path);
            return;
        }
    }
}

/* The writer of a field of an instance: the source of a connected input, or the instance's update; "" if there is none. */
static void name_writer(const fcsl_sim_t *sim, uint32_t number, const fcsl_field_t *field, char *text)
{
    const fcsl_instance_state_t *instance = &sim->plant.instances[number];
    text[0] = '\0';
    if (field->role == FCSL_ROLE_OUTPUT) {
        (void)snprintf(text, WRITER_BYTES, "instance %s", instance->name);
    }
    for (uint32_t i = 0; i < instance->copy_count; i++) {
        const fcsl_copy_t *copy = &sim->plant.copies[instance->first_copy + i];
        const uint8_t *begin = instance->data + field->offset;
        if (copy->to >= begin && copy->to < begin + field->size) {
            name_source(sim, copy->from, text);
        }
    }
}

static int describe_instance(fcsl_sim_t *sim, struct fcsl_sim_published *published, uint32_t number)
{
    const fcsl_instance_state_t *instance = &sim->plant.instances[number];
    const uint32_t count = instance->model->field_count;
    fcsl_field_t *fields = calloc(count + 1u, sizeof *fields);
    const char **writers = calloc(count + 1u, sizeof *writers);
    char *text = calloc(count + 1u, WRITER_BYTES);
    published->fields[number] = fields;
    published->writers[number] = writers;
    published->texts[number] = text;
    if (!fields || !writers || !text) {
        return -1;
    }
    memcpy(fields, instance->model->fields, count * sizeof *fields);
    for (uint32_t i = 0; i < count; i++, text += WRITER_BYTES) {
        name_writer(sim, number, &fields[i], text);
        writers[i] = text[0] ? text : NULL;
        fields[i].flags = FCSL_FIELD_WRITABLE;
    }
    published->blocks[published->first_model + number] =
        (fcsl_vars_block_t){.prefix = instance->name, .fields = fields, .field_count = count, .writers = writers};
    published->parts[published->first_model + number] =
        (fcsl_part_t){.data = instance->data, .size = instance->model->size};
    return 0;
}

static int allocate(fcsl_sim_t *sim, struct fcsl_sim_published *published)
{
    const fcsl_machine_t *machine = sim->machine;
    const uint32_t count = sim->plant.instance_count;
    published->first_model = sim->external ? 0u : 1u;
    published->instance_count = count;
    uint32_t verdict_count = 0;
    const fcsl_field_t *verdicts = sim->external ? NULL : fcsl_run_verdict_fields(sim->run, &verdict_count);
    uint32_t time_count = 0;
    const fcsl_field_t *times = sim->external ? NULL : fcsl_run_time_fields(sim->run, &time_count);
    published->count =
        count + published->first_model + (sim->actuators ? 1u : 0u) + (verdicts ? 1u : 0u) + (times ? 1u : 0u);
    published->blocks = calloc(published->count + 1u, sizeof *published->blocks);
    published->parts = calloc(published->count + 1u, sizeof *published->parts);
    published->fields = calloc(count + 1u, sizeof(fcsl_field_t *));
    published->writers = calloc(count + 1u, sizeof(const char **));
    published->texts = calloc(count + 1u, sizeof(char *));
    if (!published->blocks || !published->parts || !published->fields || !published->writers || !published->texts) {
        return -1;
    }
    if (!sim->external) {
        published->blocks[0] = (fcsl_vars_block_t){
            .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
        published->parts[0] = (fcsl_part_t){.data = fcsl_run_data(sim->run), .size = machine->size};
    }
    for (uint32_t i = 0; i < count; i++) {
        if (describe_instance(sim, published, i)) {
            return -1;
        }
    }
    if (sim->actuators) {
        const fcsl_instance_state_t *actuators = &sim->actuators->as_instance;
        published->blocks[published->first_model + count] =
            (fcsl_vars_block_t){.prefix = actuators->name,
                                .fields = actuators->model->fields,
                                .field_count = actuators->model->field_count};
        published->parts[published->first_model + count] =
            (fcsl_part_t){.data = actuators->data, .size = actuators->model->size};
    }
    uint32_t at = published->first_model + count + (sim->actuators ? 1u : 0u);
    if (verdicts) {
        published->blocks[at] =
            (fcsl_vars_block_t){.prefix = "requirements", .fields = verdicts, .field_count = verdict_count};
        uint32_t size = 0;
        const void *rows = fcsl_run_gather_verdicts(sim->run, &size);
        published->parts[at++] = (fcsl_part_t){.data = rows, .size = size};
    }
    if (times) {
        published->blocks[at] = (fcsl_vars_block_t){.prefix = "times", .fields = times, .field_count = time_count};
        uint32_t size = 0;
        const fcsl_time_row_t *rows = fcsl_run_times(sim->run, &size);
        published->parts[at] = (fcsl_part_t){.data = rows, .size = size};
    }
    return fcsl_history_open(&published->history, published->parts, published->count, HISTORY_SLOTS);
}

/* Paths must be unique: instances of models and of the machine, and what the actuators get, have different names. */
static int check_names(const fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const char *name = sim->plant.instances[i].name;
        int taken = strcmp(name, "machine") == 0 || strcmp(name, "channels") == 0 ||
                    strcmp(name, "requirements") == 0 || strcmp(name, "times") == 0;
        for (uint32_t m = 0; m < sim->machine->instance_count && !sim->external; m++) {
            taken = taken || strcmp(name, sim->machine->instances[m].name) == 0;
        }
        if (taken) {
            return fcsl_fail(error,
                             "model instance `%s` is named like a part of the machine: rename it, so that "
                             "its variables can be served",
                             name);
        }
    }
    for (uint32_t m = 0; m < sim->machine->instance_count && sim->actuators && !sim->external; m++) {
        if (strcmp(sim->machine->instances[m].name, sim->actuators->as_instance.name) == 0) {
            return fcsl_fail(error,
                             "the machine's instance `%s` is named like what the actuators get: rename it, so that "
                             "variables can be served",
                             sim->actuators->as_instance.name);
        }
    }
    return 0;
}

int fcsl_sim_publish_begin(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (sim->published) {
        return 0;
    }
    if (sim->tick || sim->sensed) {
        return fcsl_fail(error, "variables are served and sent from before the first tick");
    }
    if (check_names(sim, error)) {
        return -1;
    }
    sim->published = calloc(1, sizeof *sim->published);
    if (!sim->published || allocate(sim, sim->published)) {
        fcsl_sim_publish_end(sim);
        return fcsl_fail(error, "no memory for the published variables");
    }
    fcsl_sim_publish(sim);
    return 0;
}

void fcsl_sim_publish_end(fcsl_sim_t *sim)
{
    struct fcsl_sim_published *published = sim->published;
    if (!published) {
        return;
    }
    fcsl_observers_close(sim->observers); /* they read it */
    sim->observers = NULL;
    fcsl_ros_graph_close(sim->ros);
    sim->ros = NULL;
    fcsl_history_free(&published->history);
    for (uint32_t i = 0; i < published->instance_count; i++) {
        free(published->fields ? published->fields[i] : NULL);
        free(published->writers ? (void *)published->writers[i] : NULL);
        free(published->texts ? published->texts[i] : NULL);
    }
    free(published->blocks);
    free(published->parts);
    free(published->fields);
    free(published->writers);
    free(published->texts);
    free(published);
    sim->published = NULL;
}

void fcsl_sim_publish(fcsl_sim_t *sim)
{
    if (sim->published) {
        const fcsl_moment_t moment = {.tick = sim->tick,
                                      .time_ns = (uint64_t)sim->plant.time_ns,
                                      .paused = (uint64_t)sim->pace.paused,
                                      .next_write = sim->external ? 0u : fcsl_run_next_write(sim->run)};
        uint32_t verdict_bytes = 0;
        if (!sim->external) {
            (void)fcsl_run_gather_verdicts(sim->run, &verdict_bytes);
        }
        fcsl_history_publish(&sim->published->history, &moment);
    }
}
