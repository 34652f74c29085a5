/* SPDX-License-Identifier: Apache-2.0
 *
 * Builds the simulation from the plan: loads the named libraries, checks every name once, and fills tables of pointers, so
 * that the run loop needs no look-up by name.
 */
#include "assembly.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "base/aligned_memory.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "base/scalar_bits.h"
#include "connections.h"
#include "engine/actuators.h"
#include "engine/tick.h"
#include "group_build.h"
#include "models/model.h"
#include "output/model_messages.h"
#include "plan_names.h"

/* ---- machine, models, instances ---------------------------------------------------------------------------------------- */

static int build_machine(fcsl_sim_t *sim, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->run = fcsl_run_open(plan->machine.library, plan->machine.name, parameters, error);
    if (!sim->run) {
        return -1;
    }
    sim->machine = fcsl_run_machine(sim->run);
    const fcsl_machine_t *machine = sim->machine;
    if (plan->views && fcsl_run_set_views(sim->run, plan->views, error)) {
        return -1;
    }
    if (machine->tick_hz == 0) {
        return fcsl_fail(error, "plan line %u: the machine does not tick", plan->machine.line);
    }
    if (plan->ticks / machine->tick_hz > FCSL_PLAN_MAX_SECONDS) {
        return fcsl_fail(error, "plan line %u: more than %u s", plan->ticks_line, FCSL_PLAN_MAX_SECONDS);
    }
    const size_t sensors = fcsl_message_capacity(machine, FCSL_SENSOR_MESSAGE);
    const size_t actuators = fcsl_message_capacity(machine, FCSL_ACTUATOR_MESSAGE);
    sim->message_capacity = sensors > actuators ? sensors : actuators;
    sim->message_bytes = malloc(sim->message_capacity);
    sim->image = fcsl_sim_allocate(machine->size, machine->align);
    sim->select = calloc(machine->channel_count + 1u, 1);
    if (!sim->message_bytes || !sim->image || !sim->select) {
        return fcsl_fail(error, "no memory for the channels");
    }
    return 0;
}

static int build_companions(fcsl_sim_t *sim, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->companions = calloc(plan->companion_count + 1u, sizeof *sim->companions);
    if (!sim->companions || fcsl_delay_open(&sim->delay, plan->delay_ticks, sim->message_capacity)) {
        return fcsl_fail(error, "no memory for the controllers");
    }
    sim->companion_count = plan->companion_count;
    for (uint32_t i = 0; i < plan->companion_count; i++) {
        if (fcsl_companion_open(&sim->companions[i], &plan->companions[i], parameters, error)) {
            return -1;
        }
    }
    return 0;
}

/* Each has the values of its own sections. */
static int build_controllers(fcsl_sim_t *sim, const fcsl_parameters_t *given, fcsl_error_t *error)
{
    int used = 0;
    fcsl_parameters_t parameters = given ? *given : (fcsl_parameters_t){0};
    parameters.used = sim->plan.companion_count > 0 ? &used : NULL;
    if (build_machine(sim, given ? &parameters : NULL, error) ||
        build_companions(sim, given ? &parameters : NULL, error)) {
        return -1;
    }
    return given && parameters.used && !used ? fcsl_fail(error, "%.200s: no section is for a controller", given->name)
                                             : 0;
}

static int build_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->handles = calloc(plan->model_count + 1u, sizeof *sim->handles);
    sim->models = calloc(plan->model_count + 1u, sizeof *sim->models);
    sim->machine_models = calloc(plan->model_count + 1u, sizeof(fcsl_machine_model_t *));
    if (!sim->handles || !sim->models || !sim->machine_models) {
        return fcsl_fail(error, "no memory for the models");
    }
    for (uint32_t i = 0; i < plan->model_count; i++) {
        const fcsl_plan_library_t *from = &plan->models[i];
        if (from->is_machine) {
            sim->machine_models[i] = fcsl_machine_model_open(from->library, from->name, error);
            sim->models[i] = sim->machine_models[i] ? fcsl_machine_model_of(sim->machine_models[i]) : NULL;
        } else {
            sim->models[i] = fcsl_model_load(from->library, from->name, &sim->handles[i], error);
        }
        if (!sim->models[i]) {
            return -1;
        }
    }
    return 0;
}

static int build_instance(fcsl_sim_t *sim, uint32_t index, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    const fcsl_plan_instance_t *from = &plan->instances[index];
    fcsl_instance_state_t *instance = &sim->plant.instances[index];
    instance->name = from->name;
    for (uint32_t i = 0; i < plan->model_count; i++) {
        if (strcmp(plan->models[i].name, from->model) == 0) {
            instance->model = sim->models[i];
            instance->machine = sim->machine_models[i];
        }
    }
    if (!instance->model) {
        return fcsl_sim_fail_line(error, from->line, "no model", from->model);
    }
    if ((instance->model->update != NULL) != (from->hz > 0)) {
        return fcsl_sim_fail_line(error, from->line, "models with `update` have a rate, others none, unlike",
                                  from->name);
    }
    if (instance->model->continuous_count > 0 && from->group == FCSL_PLAN_NO_GROUP) {
        return fcsl_sim_fail_line(error, from->line, "in no group, with states to integrate:", from->name);
    }
    instance->group = from->group;
    instance->hz = from->hz;
    instance->every = from->every;
    instance->next_update = from->phase;
    instance->next_update_ns = from->hz > 0 ? fcsl_grid_time_ns(from->phase, from->hz) : INT64_MAX;
    instance->data = fcsl_sim_allocate(instance->model->size, instance->model->align);
    if (!instance->data) {
        return fcsl_fail(error, "no memory for instance `%s`", from->name);
    }
    fcsl_noise_seed(&instance->noise, plan->seed, from->name);
    if (instance->machine) {
        fcsl_machine_model_init(instance->machine, instance->data);
    }
    return 0;
}

static int build_instances(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const uint32_t count = sim->plan.instance_count;
    sim->plant.instances = calloc(count + 1u, sizeof *sim->plant.instances);
    if (!sim->plant.instances) {
        return fcsl_fail(error, "no memory for the instances");
    }
    sim->plant.instance_count = count;
    for (uint32_t i = 0; i < count; i++) {
        if (build_instance(sim, i, error)) {
            return -1;
        }
    }
    return 0;
}

/* ---- fields ---------------------------------------------------------------------------------------------------------- */

static int build_write(const fcsl_sim_t *sim, const fcsl_plan_set_t *set, fcsl_write_t *write, fcsl_error_t *error)
{
    uint32_t index = 0;
    const fcsl_field_t *field = fcsl_sim_find_field(&sim->plant, set->line, set->instance, set->field, &index, error);
    if (!field) {
        return -1;
    }
    if (field->role != FCSL_ROLE_PARAMETER && field->role != FCSL_ROLE_INPUT) {
        return fcsl_sim_fail_line(error, set->line, "neither parameter nor input:", set->field);
    }
    if (set->element >= field->count) {
        return fcsl_sim_fail_line(error, set->line, "no such element of", set->field);
    }
    const uint32_t size = fcsl_scalar_size(field->type);
    const uint64_t limit = field->type == FCSL_BOOL ? 1 : size == 4 ? UINT32_MAX : UINT64_MAX;
    if (set->bits > limit) {
        return fcsl_sim_fail_line(error, set->line, "these bits are no value of", set->field);
    }
    *write = (fcsl_write_t){sim->plant.instances[index].data + field->offset + set->element * size, size, set->bits,
                            index, sim->plant.instances[index].group};
    return 0;
}

typedef struct {
    uint64_t time_ns;
    uint32_t index;
} timed_t;

static int by_time(const void *left, const void *right)
{
    const timed_t *a = left;
    const timed_t *b = right;
    if (a->time_ns != b->time_ns) {
        return a->time_ns < b->time_ns ? -1 : 1;
    }
    return a->index < b->index ? -1 : a->index > b->index;
}

/* Events by time; those of one time as in the plan. */
static int sort_events(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const uint32_t count = sim->plan.event_count;
    timed_t *order = calloc(count + 1u, sizeof *order);
    if (!order) {
        return fcsl_fail(error, "no memory for the events");
    }
    for (uint32_t i = 0; i < count; i++) {
        order[i] = (timed_t){sim->plan.events[i].time_ns, i};
    }
    qsort(order, count, sizeof *order, by_time);
    for (uint32_t i = 0; i < count; i++) {
        sim->event_order[i] = order[i].index;
    }
    free(order);
    return 0;
}

/* "lander.outputs.landed" */
static int find_in_plant(const void *context, const char *path, fcsl_expression_operand_t *operand,
                         fcsl_expression_error_t *error)
{
    const fcsl_plant_t *plant = context;
    const size_t length = strcspn(path, ".");
    for (uint32_t i = 0; i < plant->instance_count && path[length] == '.'; i++) {
        const fcsl_instance_state_t *instance = &plant->instances[i];
        if (strlen(instance->name) == length && strncmp(instance->name, path, length) == 0) {
            return fcsl_expression_find_field(instance->model->fields, instance->model->field_count, NULL,
                                              instance->data, path + length + 1u, operand, error);
        }
    }
    *error = (fcsl_expression_error_t){.code = "unknown_path", .hint = ""};
    (void)snprintf(error->text, sizeof error->text, "no field '%.80s'", path);
    return -1;
}

static int build_until(fcsl_sim_t *sim, fcsl_error_t *error)
{
    fcsl_expression_error_t why;
    sim->until = malloc(sizeof *sim->until);
    if (sim->until == NULL) {
        return fcsl_fail(error, "no memory for the stop condition");
    }
    if (fcsl_expression_compile(sim->plan.until, find_in_plant, &sim->plant, sim->until, &why) != 0) {
        return fcsl_fail(error, "plan line %u: %s at character %zu of the stop condition", sim->plan.until_line,
                         why.text, why.at + 1u);
    }
    return sim->until->kind == FCSL_EXPRESSION_BOOL
               ? 0
               : fcsl_fail(error, "plan line %u: the stop condition is not a bool", sim->plan.until_line);
}

static int build_writes(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    for (uint32_t i = 0; i < plan->set_count; i++) {
        fcsl_write_t write;
        if (build_write(sim, &plan->sets[i], &write, error)) {
            return -1;
        }
        fcsl_write_bits(write.to, write.size, write.bits);
    }
    sim->events = calloc(plan->event_count + 1u, sizeof *sim->events);
    sim->event_order = calloc(plan->event_count + 1u, sizeof *sim->event_order);
    if (!sim->events || !sim->event_order) {
        return fcsl_fail(error, "no memory for the events");
    }
    for (uint32_t i = 0; i < plan->event_count; i++) {
        if (build_write(sim, &plan->events[i], &sim->events[i], error)) {
            return -1;
        }
    }
    if (sort_events(sim, error)) {
        return -1;
    }
    return plan->until == NULL ? 0 : build_until(sim, error);
}

/* ---- all ---------------------------------------------------------------------------------------------------------------- */

/* Whether an instance is of the model whose struct this library knows. */
static int is_serial_link(const fcsl_model_t *model)
{
    return strcmp(model->name, FCSL_SERIAL_LINK_NAME) == 0 && model->size == sizeof(fcsl_serial_link_t);
}

static int build_link(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_library_t *wanted = &sim->plan.serial_link;
    for (uint32_t i = 0; wanted->name && i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        if (strcmp(instance->name, wanted->name) == 0 && is_serial_link(instance->model)) {
            sim->link_instance = i;
            sim->link = fcsl_sim_link_open(fcsl_run_channels(sim->run), (fcsl_serial_link_t *)(void *)instance->data,
                                           &instance->noise, fcsl_sim_take_command, sim);
            return sim->link ? 0 : fcsl_fail(error, "no memory for the serial link");
        }
    }
    return wanted->name ? fcsl_sim_fail_line(error, wanted->line, "no instance of " FCSL_SERIAL_LINK_NAME, wanted->name)
                        : 0;
}

int fcsl_assembly_build(fcsl_sim_t *sim, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    if (build_controllers(sim, parameters, error) || build_models(sim, error) || build_instances(sim, error)) {
        return -1;
    }
    if (build_writes(sim, error) || fcsl_sim_build_connections(sim, error) || fcsl_sim_build_groups(sim, error)) {
        return -1;
    }
    return fcsl_actuators_build(sim, error) || build_link(sim, error) || fcsl_model_messages_build(sim, error) ? -1 : 0;
}

void fcsl_assembly_free(fcsl_sim_t *sim)
{
    fcsl_model_messages_free(sim);
    fcsl_actuators_free(sim);
    fcsl_sim_link_free(sim->link);
    for (uint32_t i = 0; sim->groups && i < sim->group_count; i++) {
        fcsl_group_free(&sim->groups[i]);
    }
    free(sim->groups);
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        free(sim->plant.instances[i].data);
    }
    for (uint32_t i = 0; sim->handles && i < sim->plan.model_count; i++) {
        fcsl_model_unload(sim->handles[i]);
        if (sim->machine_models) {
            fcsl_machine_model_close(sim->machine_models[i]);
        }
    }
    free(sim->handles);
    free(sim->machine_models);
    free(sim->models);
    free(sim->plant.instances);
    free(sim->plant.copies);
    free(sim->sensors);
    free(sim->events);
    free(sim->until);
    free(sim->event_order);
    free(sim->plant.calls);
    free(sim->writes);
    fcsl_delay_free(&sim->delay);
    free(sim->companions);
    free(sim->group_scratch);
    free(sim->before);
    free(sim->image);
    free(sim->select);
    free(sim->message_bytes);
}
