/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulations with external controllers, in step with each other: all that run are sensed and asked, then all answers are taken.
 */
#define _POSIX_C_SOURCE 200809L
#include "base/clock.h"
#include "fcsl/fcsl_error.h"
#include "engine/tick.h"
#include "engine/tick_pacing.h"
#include "external_controller.h"
#include "fcsl/fcsl_monotonic.h"
#include "output/simulation_topics.h"

static int ask(fcsl_sim_t *sim, fcsl_error_t *error)
{
    fcsl_message_t sensors;
    if (!sim->external || fcsl_external_runs_free(sim->external)) {
        return fcsl_fail(error, "only simulations in lock-step with an external controller run together");
    }
    if (fcsl_sim_sense_message(sim, sim->message_bytes, sim->message_capacity, &sensors, error)) {
        return -1;
    }
    const fcsl_hal_status_t status = fcsl_external_send(sim->external, &sensors, (uint64_t)sim->plant.time_ns);
    if (status != FCSL_HAL_OK) {
        return fcsl_sim_external_failed(sim, status, "cannot send the sensor message", error);
    }
    sim->awaits_answer = 1;
    fcsl_sim_topics_put(sim);
    return 0;
}

/* Takes the answer, if it comes in a moment. */
static int take_answer(fcsl_sim_t *sim, fcsl_error_t *error)
{
    fcsl_message_t command;
    const fcsl_hal_status_t status = fcsl_external_await(sim->external, sim->tick, sim->external_timeout_ms, &command);
    if (status == FCSL_HAL_WAITING || status == FCSL_HAL_NONE) {
        return 0;
    }
    if (status != FCSL_HAL_OK) {
        return fcsl_sim_external_failed(sim, status, "no actuator message from the controller", error);
    }
    sim->awaits_answer = 0;
    if (fcsl_sim_actuate_message(sim, &command, error)) {
        return -1;
    }
    if (sim->status != FCSL_SIM_RUNNING) {
        fcsl_sim_end(sim, 0);
    }
    return 0;
}

/* How many wait for an answer, or run. */
static uint32_t how_many(fcsl_sim_t *const *sims, uint32_t count, int waiting)
{
    uint32_t found = 0;
    for (uint32_t i = 0; i < count; i++) {
        found += waiting ? sims[i]->awaits_answer != 0 : sims[i]->status == FCSL_SIM_RUNNING;
    }
    return found;
}

static int send_sensors(fcsl_sim_t *const *sims, uint32_t count, uint32_t *failed, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < count; i++) {
        *failed = i;
        if (sims[i]->status == FCSL_SIM_RUNNING && ask(sims[i], error)) {
            return -1;
        }
    }
    return 0;
}

/* To controllers that have no tick to answer. */
static void send_keep_alive(fcsl_sim_t *const *sims, uint32_t count)
{
    for (uint32_t i = 0; i < count; i++) {
        if (!sims[i]->awaits_answer) {
            fcsl_sim_keep_alive(sims[i]);
        }
    }
}

/* One turn; controllers that have answered wait for the others. */
static int take_answers(fcsl_sim_t *const *sims, uint32_t count, uint32_t *failed, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < count; i++) {
        *failed = i;
        if (sims[i]->awaits_answer && take_answer(sims[i], error)) {
            return -1;
        }
    }
    if (how_many(sims, count, 1) > 0) {
        send_keep_alive(sims, count);
    }
    return 0;
}

/* Waits until a tick is due; 0 if it is not within the slice. */
static int is_due(fcsl_sim_t *first, uint64_t end_ns)
{
    fcsl_sim_forgive(first);
    const uint64_t due_ns = fcsl_sim_wait_until(first);
    if (due_ns == 0) {
        return 1;
    }
    fcsl_sim_sleep_until(due_ns < end_ns ? due_ns : end_ns);
    return 0;
}

static int64_t run(fcsl_sim_t *const *sims, uint32_t count, uint64_t ticks, uint64_t end_ns, uint32_t *failed,
                   fcsl_error_t *error)
{
    int64_t done = 0;
    while (((uint64_t)done < ticks || how_many(sims, count, 1) > 0) && how_many(sims, count, 0) > 0 &&
           fcsl_monotonic_ns() < end_ns) {
        if (how_many(sims, count, 1) == 0) {
            if (!is_due(sims[0], end_ns)) {
                send_keep_alive(sims, count);
                continue;
            }
            if (send_sensors(sims, count, failed, error)) {
                return -1;
            }
        }
        if (take_answers(sims, count, failed, error)) {
            return -1;
        }
        done += how_many(sims, count, 1) == 0;
    }
    return done;
}

int64_t fcsl_sim_run_together(fcsl_sim_t *const *sims, uint32_t count, uint64_t ticks, uint32_t slice_ms,
                              uint32_t *failed, fcsl_error_t *error)
{
    const uint64_t end_ns = fcsl_monotonic_ns() + (uint64_t)slice_ms * (FCSL_NS_PER_S / 1000u);
    const int64_t done = run(sims, count, ticks, end_ns, failed, error);
    fcsl_sim_topics_wake(sims[0]);
    return done;
}
