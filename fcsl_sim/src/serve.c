/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulation behind the variable server: the hosted machine's fields by their own paths, every model's below the name of
 * its instance. Commands are acted on between ticks.
 */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fail.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_vars.h"
#include "sim_internal.h"

enum { HISTORY_SLOTS = 64, WRITER_BYTES = 256 };
/* A paused simulation returns to its caller this often. */
static const uint64_t PAUSE_NS = 50000000u;

struct fcsl_sim_service {
    fcsl_vars_t *vars;
    fcsl_history_t history;
    fcsl_vars_block_t *blocks; /* the machine, if it is hosted here, then the instances */
    fcsl_part_t *parts;
    uint32_t count;
    uint32_t first_model; /* block of instance 0 */
    fcsl_field_t **fields; /* per instance: the model's table, with what a client may write */
    const char ***writers; /* per instance and field */
    char **texts;          /* per instance: what the writers point to */
    int paused;
};

/* ---- what may be written ------------------------------------------------------------------------------------------- */

/* The path of what lies at this address: an output of an instance, or an actuator channel's field. */
static void name_source(const fcsl_sim_t *sim, const uint8_t *from, char *text)
{
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const fcsl_instance_state_t *instance = &sim->instances[i];
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

/* Who writes a field of an instance: the source that its input is connected to, or its own update; "" when nobody does. */
static void name_writer(const fcsl_sim_t *sim, uint32_t number, const fcsl_field_t *field, char *text)
{
    const fcsl_instance_state_t *instance = &sim->instances[number];
    text[0] = '\0';
    if (field->role == FCSL_ROLE_OUTPUT) {
        (void)snprintf(text, WRITER_BYTES, "instance %s", instance->name);
    }
    for (uint32_t i = 0; i < instance->copy_count; i++) {
        const fcsl_copy_t *copy = &sim->copies[instance->first_copy + i];
        const uint8_t *begin = instance->data + field->offset;
        if (copy->to >= begin && copy->to < begin + field->size) {
            name_source(sim, copy->from, text);
        }
    }
}

static int describe_instance(fcsl_sim_t *sim, struct fcsl_sim_service *service, uint32_t number)
{
    const fcsl_instance_state_t *instance = &sim->instances[number];
    const uint32_t count = instance->model->field_count;
    fcsl_field_t *fields = calloc(count + 1u, sizeof *fields);
    const char **writers = calloc(count + 1u, sizeof *writers);
    char *text = calloc(count + 1u, WRITER_BYTES);
    service->fields[number] = fields;
    service->writers[number] = writers;
    service->texts[number] = text;
    if (!fields || !writers || !text) {
        return -1;
    }
    memcpy(fields, instance->model->fields, count * sizeof *fields);
    for (uint32_t i = 0; i < count; i++, text += WRITER_BYTES) {
        name_writer(sim, number, &fields[i], text);
        writers[i] = text[0] ? text : NULL;
        const int connected = fields[i].role == FCSL_ROLE_INPUT && text[0];
        fields[i].flags = connected ? 0u : FCSL_FIELD_WRITABLE;
    }
    service->blocks[service->first_model + number] =
        (fcsl_vars_block_t){.prefix = instance->name, .fields = fields, .field_count = count, .writers = writers};
    service->parts[service->first_model + number] =
        (fcsl_part_t){.data = instance->data, .size = instance->model->size};
    return 0;
}

/* ---- what the server asks ------------------------------------------------------------------------------------------ */

static fcsl_vars_status_t judge(int status)
{
    return status == 0 ? FCSL_VARS_OK : FCSL_VARS_REFUSED;
}

static fcsl_vars_status_t check_set(void *ctx, uint32_t block, uint32_t number, uint32_t element, const void *bytes,
                                    uint32_t size, fcsl_error_t *error)
{
    const fcsl_sim_t *sim = ctx;
    const struct fcsl_sim_service *service = sim->service;
    if (service->blocks[block].machine) {
        return judge(fcsl_run_check_set(sim->run, number, element, bytes, size, error));
    }
    const fcsl_field_t *field = &service->blocks[block].fields[number];
    const uint32_t scalar = fcsl_scalar_size(field->type);
    if (!(field->flags & FCSL_FIELD_WRITABLE) || element >= field->count || size / scalar > field->count - element) {
        return judge(fcsl_sim_fail(error, "'%s.%s' cannot be set", service->blocks[block].prefix, field->path));
    }
    for (uint32_t i = 0; i < size / scalar; i++) {
        uint8_t exported[8] = {0};
        fcsl_scalars_export(exported, (const uint8_t *)bytes + (size_t)i * scalar, field->type, 1);
        const double value = fcsl_as_double(fcsl_get_u64(exported), field->type);
        if (value < field->minimum || value > field->maximum) {
            return judge(fcsl_sim_fail(error, "'%s.%s' lies in [%g, %g]", service->blocks[block].prefix, field->path,
                                       field->minimum, field->maximum));
        }
    }
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t set(void *ctx, uint32_t block, uint32_t number, uint32_t element, const void *bytes,
                              uint32_t size, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    const struct fcsl_sim_service *service = sim->service;
    if (service->blocks[block].machine) {
        return judge(fcsl_run_set(sim->run, number, element, bytes, size, error));
    }
    const fcsl_field_t *field = &service->blocks[block].fields[number];
    uint8_t *to = sim->instances[block - service->first_model].data + field->offset;
    memcpy(to + (size_t)element * fcsl_scalar_size(field->type), bytes, size);
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t set_state(void *ctx, uint32_t block, int32_t state, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    (void)block;
    return judge(fcsl_run_set_state(sim->run, state, error));
}

static fcsl_vars_status_t set_paused(void *ctx, int paused, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    (void)error;
    sim->service->paused = paused;
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t run_ticks(void *ctx, uint64_t count, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    if (!sim->service->paused) {
        return FCSL_VARS_RUNNING;
    }
    for (uint64_t i = 0; i < count; i++) {
        if (sim->status != FCSL_SIM_RUNNING || sim->service_failed) {
            (void)fcsl_sim_fail(error, "the simulation is over");
            return FCSL_VARS_ENDED;
        }
        if (fcsl_sim_tick_once(sim, error)) {
            sim->failure = *error; /* the caller's next run ends with it */
            sim->service_failed = 1;
            return FCSL_VARS_FAILED;
        }
    }
    return FCSL_VARS_OK;
}

static void publish(void *ctx)
{
    fcsl_sim_t *sim = ctx;
    const fcsl_moment_t moment = {
        .tick = sim->tick, .time_ns = (uint64_t)sim->time_ns, .paused = (uint64_t)sim->service->paused};
    fcsl_history_publish(&sim->service->history, &moment);
}

static const fcsl_vars_host_t HOST = {.check_set = check_set,
                                      .set = set,
                                      .set_state = set_state,
                                      .pause = set_paused,
                                      .tick = run_ticks,
                                      .publish = publish};

/* ---- opening ------------------------------------------------------------------------------------------------------- */

static int allocate(fcsl_sim_t *sim, struct fcsl_sim_service *service)
{
    const fcsl_machine_t *machine = sim->machine;
    const uint32_t count = sim->instance_count;
    service->first_model = sim->wire ? 0u : 1u;
    service->count = count + service->first_model;
    service->blocks = calloc(service->count + 1u, sizeof *service->blocks);
    service->parts = calloc(service->count + 1u, sizeof *service->parts);
    service->fields = calloc(count + 1u, sizeof(fcsl_field_t *));
    service->writers = calloc(count + 1u, sizeof(const char **));
    service->texts = calloc(count + 1u, sizeof(char *));
    if (!service->blocks || !service->parts || !service->fields || !service->writers || !service->texts) {
        return -1;
    }
    if (!sim->wire) {
        service->blocks[0] = (fcsl_vars_block_t){
            .prefix = "", .fields = machine->fields, .field_count = machine->field_count, .machine = machine};
        service->parts[0] = (fcsl_part_t){.data = fcsl_run_data(sim->run), .size = machine->size};
    }
    for (uint32_t i = 0; i < count; i++) {
        if (describe_instance(sim, service, i)) {
            return -1;
        }
    }
    return fcsl_history_open(&service->history, service->parts, service->count, HISTORY_SLOTS);
}

/* A path must mean one thing: no model's instance may be named like one of the machine's. */
static int check_names(const fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        const char *name = sim->instances[i].name;
        int taken = strcmp(name, "machine") == 0 || strcmp(name, "channels") == 0;
        for (uint32_t m = 0; m < sim->machine->instance_count && !sim->wire; m++) {
            taken = taken || strcmp(name, sim->machine->instances[m].name) == 0;
        }
        if (taken) {
            return fcsl_sim_fail(error,
                                 "model instance `%s` is named like a part of the machine: rename it, so that "
                                 "its variables can be served",
                                 name);
        }
    }
    return 0;
}

int fcsl_sim_serve(fcsl_sim_t *sim, const char *address, const char *token, int paused, fcsl_error_t *error)
{
    if (sim->service || sim->tick || sim->sensed) {
        return fcsl_sim_fail(error, "variables are served from before the first tick, on one address");
    }
    if (check_names(sim, error)) {
        return -1;
    }
    struct fcsl_sim_service *service = calloc(1, sizeof *service);
    sim->service = service;
    if (!service || allocate(sim, service)) {
        fcsl_sim_end_service(sim);
        return fcsl_sim_fail(error, "no memory for the variable server");
    }
    service->paused = paused;
    publish(sim);
    const fcsl_vars_options_t options = {.address = address, .token = token};
    fcsl_vars_host_t host = HOST;
    host.ctx = sim;
    service->vars = fcsl_vars_open(&options, service->blocks, service->count, &service->history, &host, error);
    if (!service->vars || fcsl_vars_start(service->vars, error)) {
        fcsl_sim_end_service(sim);
        return -1;
    }
    return 0;
}

const char *fcsl_sim_address(const fcsl_sim_t *sim)
{
    return sim->service ? fcsl_vars_address(sim->service->vars) : NULL;
}

void fcsl_sim_published(fcsl_sim_t *sim)
{
    if (sim->service) {
        publish(sim);
    }
}

int fcsl_sim_attend(fcsl_sim_t *sim)
{
    struct fcsl_sim_service *service = sim->service;
    if (!service) {
        return 1;
    }
    (void)fcsl_vars_serve(service->vars);
    if (service->paused) {
        fcsl_vars_wait(service->vars, fcsl_run_monotonic_ns(NULL) + PAUSE_NS);
        (void)fcsl_vars_serve(service->vars);
    }
    return !service->paused && sim->status == FCSL_SIM_RUNNING;
}

void fcsl_sim_end_service(fcsl_sim_t *sim)
{
    struct fcsl_sim_service *service = sim->service;
    if (!service) {
        return;
    }
    fcsl_vars_close(service->vars);
    fcsl_history_free(&service->history);
    for (uint32_t i = 0; i < sim->instance_count; i++) {
        free(service->fields ? service->fields[i] : NULL);
        free(service->writers ? (void *)service->writers[i] : NULL);
        free(service->texts ? service->texts[i] : NULL);
    }
    free(service->blocks);
    free(service->parts);
    free(service->fields);
    free(service->writers);
    free(service->texts);
    free(service);
    sim->service = NULL;
}
