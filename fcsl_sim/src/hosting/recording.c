/* SPDX-License-Identifier: Apache-2.0
 *
 * The bag of the hosted machine, with what models put out, and those of its companions.
 */
#include "recording.h"

#include <stdio.h>

#include "fcsl/fcsl_error.h"
#include "output/model_messages.h"

int fcsl_sim_record_model_message(fcsl_sim_t *sim, const fcsl_instance_state_t *instance,
                                  const fcsl_model_message_t *message, fcsl_error_t *error)
{
    const size_t bytes =
        fcsl_model_message_write(sim->plant.time_ns, instance, sim->model_message_bytes, message->size);
    return fcsl_run_record_write(sim->run, message->topic, (uint64_t)sim->plant.time_ns, sim->model_message_bytes,
                                 (uint32_t)bytes, error);
}

static int add_model_topic(fcsl_sim_t *sim, const char *name, fcsl_model_message_t *message, const char *name_space,
                           fcsl_error_t *error)
{
    char topic[512];
    const int bytes = snprintf(topic, sizeof topic, "%s%s/sim/%s", name_space[0] ? "/" : "", name_space, name);
    if (bytes < 0 || (size_t)bytes >= sizeof topic) {
        return fcsl_fail(error, "the name of a topic is too long: /%s/sim/%s", name_space, name);
    }
    message->topic = fcsl_run_record_add_topic(sim->run, topic, message->type, message->schema, error);
    return message->topic < 0 ? -1 : 0;
}

/* A companion has a bag of its own beside that of the first controller: BAG_NAME. */
static int record_companion(const fcsl_companion_t *companion, const fcsl_record_options_t *first, fcsl_error_t *error)
{
    char path[4096];
    const int bytes = snprintf(path, sizeof path, "%s_%s", first->bag, companion->name);
    if (bytes < 0 || (size_t)bytes >= sizeof path) {
        return fcsl_fail(error, "the name of a bag is too long: %s_%s", first->bag, companion->name);
    }
    fcsl_record_options_t options = *first;
    options.bag = path;
    return fcsl_run_record(companion->run, &options, error);
}

int fcsl_sim_record(fcsl_sim_t *sim, const char *bag, const char *name_space, const char *split, fcsl_error_t *error)
{
    if (sim->sensed || sim->external) {
        return fcsl_fail(error, "recording must begin between two ticks, with the controller in this process");
    }
    const fcsl_record_options_t options = {.bag = bag, .name_space = name_space, .lossless = 1, .split = split};
    if (fcsl_run_record(sim->run, &options, error)) {
        return -1;
    }
    int failed = 0;
    for (uint32_t i = 0; i < sim->plant.instance_count && !failed; i++) {
        failed = add_model_topic(sim, sim->plant.instances[i].name, &sim->model_messages[i], name_space, error);
    }
    if (!failed && sim->actuators) {
        failed = add_model_topic(sim, sim->actuators->as_instance.name, &sim->actuators->message, name_space, error);
    }
    if (failed) {
        (void)fcsl_run_record_stop(sim->run, NULL);
        return -1;
    }
    sim->recording = 1;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        if (record_companion(&sim->companions[i], &options, error)) {
            (void)fcsl_sim_record_stop(sim, NULL);
            return -1;
        }
    }
    return 0;
}

int fcsl_sim_record_stop(fcsl_sim_t *sim, fcsl_error_t *error)
{
    int status = 0;
    sim->recording = 0;
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        status = fcsl_run_record_stop(sim->companions[i].run, error) != 0 ? -1 : status;
    }
    return fcsl_run_record_stop(sim->run, error) != 0 ? -1 : status;
}
