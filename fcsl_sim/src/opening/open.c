/* SPDX-License-Identifier: Apache-2.0
 *
 * Opens and closes a simulation.
 */
#include <stdlib.h>

#include "fcsl/fcsl_fp_mode.h"
#include "assembly.h"
#include "fcsl/fcsl_error.h"
#include "checkpoints/plant_state.h"
#include "engine/crash_handler.h"
#include "engine/instants.h"
#include "hosting/variable_server.h"
#include "output/publish.h"
#include "output/simulation_topics.h"
#include "plant/model_contract.h"
#include "plant/model_prototypes.h"

static int init_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->plant.instance_count; i++) {
        fcsl_instance_state_t *instance = &sim->plant.instances[i];
        const fcsl_model_context_t context = fcsl_plant_context(&sim->plant, i, 0);
        fcsl_plant_enter(&sim->plant, i, FCSL_IN_INIT);
        if (instance->machine && fcsl_machine_model_start(instance->machine, instance->data, error)) {
            return -1;
        }
        const char *wrong = instance->model->init ? instance->model->init(instance->data, &context) : NULL;
        if (fcsl_sim_check_fp_mode(instance->name, error)) {
            return -1;
        }
        if (wrong) {
            return fcsl_fail(error, "instance `%s`: %s", instance->name, fcsl_sim_init_reason(wrong));
        }
        if (fcsl_sim_check_contract(&sim->plant, i, error) || fcsl_sim_check_prototypes(&sim->plant, i, error)) {
            return -1;
        }
    }
    for (uint32_t i = 0; i < sim->group_count; i++) {
        if (fcsl_group_check(&sim->groups[i], error) || fcsl_group_start(&sim->groups[i], error)) {
            return -1;
        }
    }
    fcsl_plant_enter(&sim->plant, 0, FCSL_IN_NONE);
    return 0;
}

static int start_models(fcsl_sim_t *sim, fcsl_error_t *error)
{
    const fcsl_fp_mode_t callers = fcsl_fp_enter(); /* that of the libraries of models, now that they are loaded */
    const int failed = init_models(sim, error);
    fcsl_fp_leave(callers);
    return failed;
}

static int fill_queue(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (fcsl_event_queue_init(&sim->queue, sim->plant.instance_count + sim->companion_count + 1u)) {
        return fcsl_fail(error, "no memory for the event queue");
    }
    fcsl_sim_refill_queue(sim);
    size_t vectors = 1;
    for (uint32_t i = 0; i < sim->group_count; i++) {
        const size_t saved = fcsl_group_saved(&sim->groups[i]);
        vectors = saved > vectors ? saved : vectors;
    }
    sim->group_scratch = calloc(vectors, sizeof *sim->group_scratch);
    sim->before = malloc(fcsl_plant_state_bytes(sim) + 1u);
    return sim->group_scratch && sim->before ? 0 : fcsl_fail(error, "no memory for checkpoints");
}

static int attach(fcsl_sim_t *sim, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < sim->companion_count; i++) {
        if (fcsl_companion_start(&sim->companions[i], error)) {
            return -1;
        }
    }
    return fcsl_run_attach(sim->run, error);
}

fcsl_sim_t *fcsl_sim_open(const char *plan, size_t size, const fcsl_parameters_t *parameters, fcsl_error_t *error)
{
    fcsl_sim_t *sim = calloc(1, sizeof *sim);
    if (!sim) {
        (void)fcsl_fail(error, "no memory for a simulation");
        return NULL;
    }
    fcsl_sim_is_open(&sim->plant, 1);
    if (fcsl_plan_parse(&sim->plan, plan, size, error) || fcsl_assembly_build(sim, parameters, error) ||
        start_models(sim, error) || fill_queue(sim, error) || attach(sim, error)) {
        (void)fcsl_sim_close(sim, NULL);
        return NULL;
    }
    return sim;
}

int fcsl_sim_close(fcsl_sim_t *sim, fcsl_error_t *error)
{
    if (!sim) {
        return 0;
    }
    int status = 0;
    fcsl_sim_is_open(&sim->plant, 0);
    fcsl_sim_end_service(sim);
    fcsl_telemetry_close(sim->telemetry);
    fcsl_sim_publish_end(sim);
    fcsl_external_close(sim->external);
    fcsl_sim_topics_free(sim);
    fcsl_event_queue_free(&sim->queue);
    for (uint32_t i = 0; sim->companions && i < sim->companion_count; i++) {
        status = fcsl_companion_close(&sim->companions[i], error) != 0 ? -1 : status;
    }
    fcsl_assembly_free(sim);
    if (sim->run) {
        status = fcsl_run_close(sim->run, error) != 0 ? -1 : status;
    }
    fcsl_plan_free(&sim->plan);
    free(sim);
    return status;
}
