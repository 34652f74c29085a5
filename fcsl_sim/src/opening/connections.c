/* SPDX-License-Identifier: Apache-2.0
 *
 * The connections of the plan: checks each once, and makes a table of copies from pointer to pointer.
 */
#include "connections.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_channels.h"
#include "plan_names.h"

static int same_kind(const fcsl_field_t *a, const fcsl_field_t *b)
{
    if (a->type != b->type || a->rank != b->rank) {
        return 0;
    }
    for (uint32_t i = 0; i < a->rank; i++) {
        if (a->shape[i] != b->shape[i]) {
            return 0;
        }
    }
    return !a->unit[0] || !b->unit[0] || strcmp(a->unit, b->unit) == 0;
}

static int check_pair(const fcsl_plan_link_t *link, const fcsl_field_t *from, const fcsl_field_t *to,
                      fcsl_error_t *error)
{
    if (same_kind(from, to)) {
        return 0;
    }
    return fcsl_fail(error, "plan line %u: `%s` and `%s` differ in type, shape or unit", link->line, link->from_field,
                     link->to_field);
}

/* The companion of this name; null: the first controller. Returns 0, or -1. */
static int find_companion(const fcsl_sim_t *sim, uint32_t line, const char *name, fcsl_companion_t **companion,
                          fcsl_error_t *error)
{
    *companion = NULL;
    for (uint32_t i = 0; name && i < sim->companion_count; i++) {
        if (strcmp(sim->companions[i].name, name) == 0) {
            *companion = &sim->companions[i];
        }
    }
    return name && !*companion ? fcsl_sim_fail_line(error, line, "no controller", name) : 0;
}

static int find_channel(const fcsl_machine_t *machine, uint32_t line, const char *name, fcsl_direction_t direction,
                        uint32_t *channel, fcsl_error_t *error)
{
    const fcsl_channel_t *found = fcsl_find_channel(machine, name, strlen(name));
    if (!found) {
        return fcsl_sim_fail_line(error, line, "the machine has no channel", name);
    }
    *channel = (uint32_t)(found - machine->channels);
    return found->direction == direction ? 0 : fcsl_sim_fail_line(error, line, "wrong direction of channel", name);
}

static const fcsl_field_t *find_machine_field(const fcsl_sim_t *sim, uint32_t line, const char *path,
                                              fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->machine->field_count; i++) {
        if (strcmp(sim->machine->fields[i].path, path) == 0) {
            return &sim->machine->fields[i];
        }
    }
    (void)fcsl_sim_fail_line(error, line, "the machine has no field", path);
    return NULL;
}

/* What a controller gives: an actuator channel, or any field of the first one. */
static const fcsl_field_t *find_source(fcsl_sim_t *sim, const fcsl_plan_link_t *link, int is_field, fcsl_copy_t *copy,
                                       fcsl_error_t *error)
{
    fcsl_companion_t *companion = NULL;
    uint32_t channel = 0;
    copy->source = UINT32_MAX;
    if (is_field) {
        const fcsl_field_t *field = find_machine_field(sim, link->line, link->from_field, error);
        copy->from = field ? (const uint8_t *)fcsl_run_data(sim->run) + field->offset : NULL;
        sim->reads_fields = 1;
        return field;
    }
    if (find_companion(sim, link->line, link->companion, &companion, error)) {
        return NULL;
    }
    const fcsl_machine_t *machine = companion ? companion->machine : sim->machine;
    if (find_channel(machine, link->line, link->from_field, FCSL_ACTUATOR, &channel, error)) {
        return NULL;
    }
    const fcsl_field_t *field = &machine->fields[machine->channels[channel].field];
    copy->companion = companion ? (uint32_t)(companion - sim->companions) : FCSL_NO_COMPANION;
    copy->from = (companion ? companion->image : sim->image) + field->offset;
    return field;
}

static int add_copy(fcsl_sim_t *sim, const fcsl_plan_link_t *link, int is_field, fcsl_error_t *error)
{
    fcsl_copy_t *copy = &sim->plant.copies[sim->plant.copy_count];
    copy->companion = FCSL_NO_COMPANION;
    const fcsl_field_t *to =
        fcsl_sim_find_field(&sim->plant, link->line, link->to_instance, link->to_field, &copy->instance, error);
    if (!to) {
        return -1;
    }
    if (to->role != FCSL_ROLE_INPUT) {
        return fcsl_sim_fail_line(error, link->line, "not an input:", link->to_field);
    }
    const fcsl_field_t *from;
    if (link->from_instance) {
        uint32_t source = 0;
        from = fcsl_sim_find_field(&sim->plant, link->line, link->from_instance, link->from_field, &source, error);
        if (!from) {
            return -1;
        }
        if (from->role != FCSL_ROLE_OUTPUT) {
            return fcsl_sim_fail_line(error, link->line, "not an output:", link->from_field);
        }
        const fcsl_instance_state_t *feeds = &sim->plant.instances[source];
        const fcsl_instance_state_t *fed = &sim->plant.instances[copy->instance];
        copy->is_inner = feeds->model->output != NULL && feeds->group == fed->group && fed->group != FCSL_PLAN_NO_GROUP;
        copy->source = source;
        copy->from = sim->plant.instances[source].data + from->offset;
    } else {
        from = find_source(sim, link, is_field, copy, error);
        if (!from) {
            return -1;
        }
    }
    if (check_pair(link, from, to, error)) {
        return -1;
    }
    copy->to = sim->plant.instances[copy->instance].data + to->offset;
    copy->size = to->size;
    for (uint32_t i = 0; i < sim->plant.copy_count; i++) {
        if (sim->plant.copies[i].to == copy->to) {
            return fcsl_sim_fail_line(error, link->line, "two sources for", link->to_field);
        }
    }
    sim->plant.copy_count++;
    return 0;
}

static int by_instance(const void *left, const void *right)
{
    const fcsl_copy_t *a = left;
    const fcsl_copy_t *b = right;
    if (a->instance != b->instance) {
        return a->instance < b->instance ? -1 : 1;
    }
    if (a->is_inner != b->is_inner) {
        return a->is_inner < b->is_inner ? -1 : 1;
    }
    return a->to < b->to ? -1 : a->to > b->to;
}

static int build_copies(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->plant.copies =
        calloc(plan->link_count + plan->actuator_count + plan->read_count + 1u, sizeof *sim->plant.copies);
    if (!sim->plant.copies) {
        return fcsl_fail(error, "no memory for the connections");
    }
    for (uint32_t i = 0; i < plan->link_count; i++) {
        if (add_copy(sim, &plan->links[i], 0, error)) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < plan->actuator_count; i++) {
        if (add_copy(sim, &plan->actuators[i], 0, error)) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < plan->read_count; i++) {
        if (add_copy(sim, &plan->reads[i], 1, error)) {
            return -1;
        }
    }
    qsort(sim->plant.copies, sim->plant.copy_count, sizeof *sim->plant.copies, by_instance);
    for (uint32_t i = sim->plant.copy_count; i-- > 0;) {
        fcsl_instance_state_t *instance = &sim->plant.instances[sim->plant.copies[i].instance];
        instance->first_copy = i;
        instance->copy_count++;
        instance->inner_count += sim->plant.copies[i].is_inner;
        instance->outer_count += !sim->plant.copies[i].is_inner;
    }
    return 0;
}

/* Adds a sensor of the first controller, or of a companion. */
static int add_sensor(fcsl_sim_t *sim, const fcsl_plan_link_t *link, fcsl_error_t *error)
{
    fcsl_companion_t *companion = NULL;
    if (find_companion(sim, link->line, link->companion, &companion, error)) {
        return -1;
    }
    const fcsl_machine_t *machine = companion ? companion->machine : sim->machine;
    fcsl_sensor_t *sensors = companion ? companion->sensors : sim->sensors;
    uint32_t *count = companion ? &companion->sensor_count : &sim->sensor_count;
    fcsl_sensor_t *sensor = &sensors[*count];
    const fcsl_field_t *from =
        fcsl_sim_find_field(&sim->plant, link->line, link->from_instance, link->from_field, &sensor->instance, error);
    if (!from || find_channel(machine, link->line, link->to_field, FCSL_SENSOR, &sensor->channel, error)) {
        return -1;
    }
    if (from->role != FCSL_ROLE_OUTPUT) {
        return fcsl_sim_fail_line(error, link->line, "not an output:", link->from_field);
    }
    const fcsl_field_t *to = &machine->fields[machine->channels[sensor->channel].field];
    if (check_pair(link, from, to, error)) {
        return -1;
    }
    for (uint32_t j = 0; j < *count; j++) {
        if (sensors[j].channel == sensor->channel) {
            return fcsl_sim_fail_line(error, link->line, "two sources for channel", link->to_field);
        }
    }
    sensor->from = sim->plant.instances[sensor->instance].data + from->offset;
    sensor->to = (companion ? companion->image : sim->image) + to->offset;
    sensor->size = to->size;
    (*count)++;
    return 0;
}

/* After the sensors: when one of them gets its first sample. */
static int delay_first_sample(fcsl_sim_t *sim, const fcsl_plan_first_sample_t *first, fcsl_error_t *error)
{
    fcsl_companion_t *companion = NULL;
    uint32_t channel = 0;
    if (find_companion(sim, first->line, first->companion, &companion, error) ||
        find_channel(companion ? companion->machine : sim->machine, first->line, first->channel, FCSL_SENSOR, &channel,
                     error)) {
        return -1;
    }
    fcsl_sensor_t *sensors = companion ? companion->sensors : sim->sensors;
    const uint32_t count = companion ? companion->sensor_count : sim->sensor_count;
    for (uint32_t i = 0; i < count; i++) {
        if (sensors[i].channel == channel) {
            sensors[i].first_ns = (int64_t)first->time_ns;
            return 0;
        }
    }
    return fcsl_sim_fail_line(error, first->line, "nothing feeds channel", first->channel);
}

static int build_sensors(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->sensors = calloc(plan->sensor_count + 1u, sizeof *sim->sensors);
    int is_memory = sim->sensors != NULL;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        sim->companions[i].sensors = calloc(plan->sensor_count + 1u, sizeof *sim->sensors);
        is_memory = is_memory && sim->companions[i].sensors != NULL;
    }
    if (!is_memory) {
        return fcsl_fail(error, "no memory for the sensors");
    }
    for (uint32_t i = 0; i < plan->sensor_count; i++) {
        if (add_sensor(sim, &plan->sensors[i], error)) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < plan->first_sample_count; i++) {
        if (delay_first_sample(sim, &plan->first_samples[i], error)) {
            return -1;
        }
    }
    return 0;
}

/* Outputs of models to fields of the hosted machine. */
static int build_field_writes(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->writes = calloc(plan->write_count + 1u, sizeof *sim->writes);
    if (!sim->writes) {
        return fcsl_fail(error, "no memory for the connections");
    }
    for (uint32_t i = 0; i < plan->write_count; i++) {
        const fcsl_plan_link_t *link = &plan->writes[i];
        uint32_t source = 0;
        const fcsl_field_t *from =
            fcsl_sim_find_field(&sim->plant, link->line, link->from_instance, link->from_field, &source, error);
        const fcsl_field_t *to = from ? find_machine_field(sim, link->line, link->to_field, error) : NULL;
        if (!to || check_pair(link, from, to, error)) {
            return -1;
        }
        if (from->role != FCSL_ROLE_OUTPUT || (to->flags & FCSL_FIELD_WRITABLE) == 0) {
            return fcsl_sim_fail_line(error, link->line,
                                      "not from an output to a field that a host may write:", link->to_field);
        }
        sim->writes[sim->write_count++] = (fcsl_field_link_t){
            (uint32_t)(to - sim->machine->fields), sim->plant.instances[source].data + from->offset, from->size};
    }
    return 0;
}

int fcsl_sim_build_connections(fcsl_sim_t *sim, fcsl_error_t *error)
{
    return build_copies(sim, error) || build_sensors(sim, error) || build_field_writes(sim, error) ? -1 : 0;
}
