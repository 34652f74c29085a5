/* SPDX-License-Identifier: Apache-2.0
 *
 * The simulation behind the variable server: the hosted machine's fields by their own paths, every model's below the name of
 * its instance. Commands are executed between ticks.
 */
#include "variable_server.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_error.h"
#include "engine/tick_pacing.h"
#include "exchange.h"
#include "output/publish.h"
#include "service.h"

/* ---- callbacks of the server---------------------------------------------------------------------------------------- */

static void set(void *ctx, uint32_t block, uint32_t number, uint32_t element, const void *bytes, uint32_t size)
{
    fcsl_sim_t *sim = ctx;
    const struct fcsl_sim_published *published = sim->published;
    const fcsl_field_t *field = &published->blocks[block].fields[number];
    const uint32_t instance = block - published->first_model;
    fcsl_error_t error; /* commands are executed between two ticks, and a field lies within its struct */
    (void)fcsl_sim_write(sim, instance, field->offset + element * fcsl_scalar_size(field->type), bytes, size, &error);
}

static void save(void *ctx)
{
    const fcsl_sim_t *sim = ctx;
    fcsl_sim_snapshot_take(sim, sim->service->snapshot);
}

static fcsl_vars_status_t restore(void *ctx, const void *data, uint32_t size, const fcsl_hw_sim_t *hardware,
                                  fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    (void)size; /* the machine struct is compared, and the snapshot has the rest */
    return fcsl_sim_snapshot_restore(sim, sim->service->snapshot, data, hardware, error) == 0 ? FCSL_VARS_OK
                                                                                              : FCSL_VARS_REFUSED;
}

static fcsl_vars_status_t set_paused(void *ctx, int paused, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    (void)error;
    sim->pace.paused = paused;
    if (paused) {
        fcsl_sim_pace_anew(sim);
    }
    return FCSL_VARS_OK;
}

static fcsl_vars_status_t run_ticks(void *ctx, uint64_t count, fcsl_error_t *error)
{
    fcsl_sim_t *sim = ctx;
    if (!sim->pace.paused) {
        return FCSL_VARS_NOT_PAUSED;
    }
    for (uint64_t i = 0; i < count; i++) {
        if (sim->status != FCSL_SIM_RUNNING || sim->service_failed) {
            (void)fcsl_fail(error, "the simulation is over");
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
    fcsl_sim_publish(ctx);
}

static void write_stats(void *ctx, fcsl_vars_out_t *out)
{
    const fcsl_sim_t *sim = ctx;
    fcsl_vars_tick_stats(out, &sim->service->stats);
    if (sim->telemetry) {
        fcsl_telemetry_stats(sim->telemetry, out);
    }
    if (sim->ros) {
        fcsl_ros_graph_stats(sim->ros, out);
    }
    if (sim->observers) {
        fcsl_observers_stats(sim->observers, out);
    }
}

/* ---- opening ------------------------------------------------------------------------------------------------------- */

int fcsl_sim_serve(fcsl_sim_t *sim, const char *address, const char *token, const char *checkpoints, int paused,
                   fcsl_error_t *error)
{
    if (sim->service || sim->tick || sim->sensed) {
        return fcsl_fail(error, "variables are served from before the first tick, on one address");
    }
    if (fcsl_sim_publish_begin(sim, error)) {
        return -1;
    }
    struct fcsl_sim_service *service = calloc(1, sizeof *service);
    sim->service = service;
    if (!service) {
        return fcsl_fail(error, "no memory for the variable server");
    }
    sim->pace.paused = paused;
    service->snapshot = fcsl_sim_snapshot_open(sim);
    if (!service->snapshot) {
        fcsl_sim_end_service(sim);
        return fcsl_fail(error, "no memory for a checkpoint of the simulation");
    }
    fcsl_sim_publish(sim);
    const struct fcsl_sim_published *published = sim->published;
    const fcsl_vars_options_t options = {.address = address, .token = token, .checkpoints = checkpoints};
    const fcsl_vars_host_t host = {.ctx = sim,
                                   .run = sim->run,
                                   .set = set,
                                   .save = save,
                                   .restore = restore,
                                   .pause = set_paused,
                                   .tick = run_ticks,
                                   .publish = publish,
                                   .stats = write_stats};
    service->vars = fcsl_vars_open(&options, published->blocks, published->count, &published->history, &host, error);
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

int fcsl_sim_serve_clients(fcsl_sim_t *sim)
{
    struct fcsl_sim_service *service = sim->service;
    if (service) {
        fcsl_vars_serve(service->vars);
    }
    const uint64_t until = fcsl_sim_wait_until(sim);
    if (until == 0) {
        return sim->status == FCSL_SIM_RUNNING;
    }
    fcsl_sim_keep_alive(sim);
    if (service) {
        fcsl_vars_wait(service->vars, until);
        fcsl_vars_serve(service->vars);
    } else {
        fcsl_sim_sleep_until(until);
    }
    return 0;
}

void fcsl_sim_end_service(fcsl_sim_t *sim)
{
    if (sim->service) {
        fcsl_vars_close(sim->service->vars);
        fcsl_sim_snapshot_free(sim->service->snapshot);
        free(sim->service);
        sim->service = NULL;
        sim->pace.paused = 0;
    }
}
