/* SPDX-License-Identifier: Apache-2.0
 *
 * Builds the groups of a simulation: lists of instances, so that a step needs no look-up.
 */
#include "group_build.h"

#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "plan_names.h"

/* ---- calls ----------------------------------------------------------------------------------------------------------- */

static int check_call(const fcsl_sim_t *sim, const fcsl_plan_call_t *from, const fcsl_call_t *call, fcsl_error_t *error)
{
    const fcsl_model_t *model = sim->plant.instances[call->instance].model;
    const int is_there = call->kind == FCSL_CALL_UPDATE ? model->update != NULL : model->output != NULL;
    if (!is_there) {
        return fcsl_fail(error, "plan line %u: model `%s` has no such function", from->line, model->name);
    }
    if (call->kind == FCSL_CALL_STAGE && sim->plant.instances[call->instance].group == FCSL_PLAN_NO_GROUP) {
        return fcsl_fail(error, "plan line %u: `%s` is in no group", from->line, from->instance);
    }
    return 0;
}

/* Whether every `output` is called, and every `update` once. */
static int check_complete(const fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        const fcsl_model_t *model = sim->plant.instances[i].model;
        uint32_t outputs = 0;
        uint32_t updates = 0;
        for (uint32_t k = 0; k < sim->plant.call_count; k++) {
            const int is_here = sim->plant.calls[k].instance == i;
            outputs += is_here && sim->plant.calls[k].kind != FCSL_CALL_UPDATE;
            updates += is_here && sim->plant.calls[k].kind == FCSL_CALL_UPDATE;
        }
        if ((model->output != NULL && outputs == 0) || (model->update != NULL && updates != 1u)) {
            return fcsl_fail(error, "plan line %u: `%s` is not called as its model needs it",
                             sim->plan.instances[i].line, sim->plant.instances[i].name);
        }
    }
    return 0;
}

static int build_calls(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_plan_t *plan = &sim->plan;
    sim->plant.calls = calloc(plan->call_count + 1u, sizeof *sim->plant.calls);
    if (!sim->plant.calls) {
        return fcsl_fail(error, "no memory for the order of evaluation");
    }
    sim->plant.call_count = plan->call_count;
    for (uint32_t i = 0; i < plan->call_count; i++) {
        sim->plant.calls[i].kind = plan->calls[i].kind;
        if (fcsl_sim_find_instance(&sim->plant, plan->calls[i].line, plan->calls[i].instance,
                                   &sim->plant.calls[i].instance, error) ||
            check_call(sim, &plan->calls[i], &sim->plant.calls[i], error)) {
            return -1;
        }
    }
    return check_complete(sim, error);
}

/* ---- lists of a group ------------------------------------------------------------------------------------------------- */

static void add_calls(const fcsl_sim_t *sim, fcsl_group_t *group, uint32_t number)
{
    for (uint32_t i = 0; i < sim->plant.call_count; i++) {
        const fcsl_call_t *call = &sim->plant.calls[i];
        if (call->kind != FCSL_CALL_UPDATE && sim->plant.instances[call->instance].group == number) {
            group->outputs[group->output_count++] = call->instance;
            if (call->kind == FCSL_CALL_STAGE) {
                group->stages[group->stage_count++] = call->instance;
            }
        }
    }
}

static int add_members(fcsl_sim_t *sim, fcsl_group_t *group, uint32_t number, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        const fcsl_model_t *model = instance->model;
        if (instance->group != number) {
            continue;
        }
        if (group->plan->method == FCSL_VERLET && model->continuous_count > 0 && !model->is_second_order) {
            return fcsl_fail(error, "plan line %u: model `%s` declares no positions and velocities for verlet",
                             group->plan->line, model->name);
        }
        if (model->continuous_count > 0) {
            group->blocks[group->derived_count] = model->continuous_count;
            group->derived[group->derived_count++] = i;
            instance->first_state = group->n;
            group->n += model->continuous_count;
        }
        if (model->event_count > 0) {
            group->eventful[group->eventful_count++] = i;
            instance->first_event = group->event_count;
            group->event_count += model->event_count;
        }
        if (model->next_time) {
            group->announcing[group->announcing_count++] = i;
        }
        if (model->update) {
            group->timed[group->timed_count++] = i;
        }
    }
    return 0;
}

static void add_once(uint32_t *list, uint32_t *count, uint32_t item)
{
    for (uint32_t i = 0; i < *count; i++) {
        if (list[i] == item) {
            return;
        }
    }
    list[(*count)++] = item;
}

/* Inputs from outside; what is updated to change them ends a step. */
static void add_outer(const fcsl_sim_t *sim, fcsl_group_t *group, uint32_t number)
{
    for (uint32_t i = 0; i < sim->plant.copy_count; i++) {
        const fcsl_copy_t *copy = &sim->plant.copies[i];
        if (sim->plant.instances[copy->instance].group != number || copy->is_inner) {
            continue;
        }
        group->outer[group->outer_count++] = i;
        if (copy->source != UINT32_MAX && sim->plant.instances[copy->source].group != number &&
            sim->plant.instances[copy->source].model->update) {
            add_once(group->timed, &group->timed_count, copy->source);
        }
    }
}

/* Who reads outputs of the group at instants of its own: updates of others, and controllers. */
static void add_readers(const fcsl_sim_t *sim, fcsl_group_t *group, uint32_t number)
{
    for (uint32_t i = 0; i < sim->plant.copy_count; i++) {
        const fcsl_copy_t *copy = &sim->plant.copies[i];
        const fcsl_instance_state_t *reader = &sim->plant.instances[copy->instance];
        if (copy->source != UINT32_MAX && sim->plant.instances[copy->source].group == number &&
            reader->group != number && reader->model->update) {
            add_once(group->sampling, &group->sampling_count, copy->instance);
        }
    }
    for (uint32_t c = 0; c < sim->companion_count; c++) {
        const fcsl_companion_t *companion = &sim->companions[c];
        for (uint32_t i = 0; i < companion->sensor_count; i++) {
            group->companions[c] |= sim->plant.instances[companion->sensors[i].instance].group == number;
        }
        for (uint32_t i = 0; i < group->outer_count; i++) {
            group->companions[c] |= sim->plant.copies[group->outer[i]].companion == c;
        }
    }
}

/* Behind a serial line commands arrive at its own instants. */
static int add_link(const fcsl_sim_t *sim, fcsl_group_t *group, fcsl_error_t *error)
{
    const fcsl_plan_library_t *link = &sim->plan.serial_link;
    uint32_t index = 0;
    for (uint32_t i = 0; link->name && i < group->outer_count; i++) {
        if (sim->plant.copies[group->outer[i]].source == UINT32_MAX) {
            if (fcsl_sim_find_instance(&sim->plant, link->line, link->name, &index, error)) {
                return -1;
            }
            add_once(group->timed, &group->timed_count, index);
            return 0;
        }
    }
    return 0;
}

static void add_crossings(const fcsl_sim_t *sim, fcsl_group_t *group)
{
    for (uint32_t i = 0; i < group->eventful_count; i++) {
        const fcsl_instance_state_t *instance = &sim->plant.instances[group->eventful[i]];
        for (uint32_t k = 0; k < instance->model->event_count; k++) {
            group->crossing[instance->first_event + k] = instance->model->events[k].crossing;
        }
    }
}

static int build_group(fcsl_sim_t *sim, uint32_t number, fcsl_error_t *error)
{
    fcsl_group_t *group = &sim->groups[number];
    const size_t count = sim->plant.instance_count + 1u;
    group->plan = &sim->plan.groups[number];
    group->derived = calloc(count, sizeof *group->derived);
    group->blocks = calloc(count, sizeof *group->blocks);
    group->eventful = calloc(count, sizeof *group->eventful);
    group->timed = calloc(count, sizeof *group->timed);
    group->announcing = calloc(count, sizeof *group->announcing);
    group->stages = calloc(sim->plant.call_count + 1u, sizeof *group->stages);
    group->outputs = calloc(sim->plant.call_count + 1u, sizeof *group->outputs);
    group->outer = calloc(sim->plant.copy_count + 1u, sizeof *group->outer);
    group->sampling = calloc(count, sizeof *group->sampling);
    group->companions = calloc(sim->companion_count + 1u, sizeof *group->companions);
    if (!group->derived || !group->blocks || !group->eventful || !group->timed || !group->sampling ||
        !group->announcing || !group->companions || !group->stages || !group->outputs || !group->outer) {
        return fcsl_fail(error, "no memory for a group of models");
    }
    add_calls(sim, group, number);
    if (add_members(sim, group, number, error)) {
        return -1;
    }
    add_outer(sim, group, number);
    add_readers(sim, group, number);
    if (add_link(sim, group, error)) {
        return -1;
    }
    group->crossing = calloc(group->event_count + 1u, 1);
    group->fired = calloc(group->event_count + 1u, 1);
    if (!group->crossing || !group->fired) {
        return fcsl_fail(error, "no memory for events");
    }
    add_crossings(sim, group);
    return fcsl_group_open(group, &sim->plant, error);
}

static int build_tolerances(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plan.tolerance_count; i++) {
        const fcsl_plan_tolerance_t *tolerance = &sim->plan.tolerances[i];
        uint32_t index = 0;
        if (fcsl_sim_find_instance(&sim->plant, tolerance->line, tolerance->instance, &index, error)) {
            return -1;
        }
        const fcsl_instance_state_t *instance = &sim->plant.instances[index];
        if (tolerance->state >= instance->model->continuous_count) {
            return fcsl_fail(error, "plan line %u: `%s` has no such state", tolerance->line, tolerance->instance);
        }
        sim->groups[instance->group].atol[instance->first_state + tolerance->state] = tolerance->atol;
    }
    return 0;
}

int fcsl_sim_build_groups(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (build_calls(sim, error)) {
        return -1;
    }
    sim->groups = calloc(sim->plan.group_count + 1u, sizeof *sim->groups);
    if (!sim->groups) {
        return fcsl_fail(error, "no memory for the groups of models");
    }
    sim->group_count = sim->plan.group_count;
    for (uint32_t i = 0; i < sim->group_count; i++) {
        if (build_group(sim, i, error)) {
            return -1;
        }
    }
    return build_tolerances(sim, error);
}
