/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_sim.h: the plan of a simulation, parsed; what it names, loaded and connected; a few ticks of it. The libraries of the
 * seeds lie in the folder in which this runs.
 */
#include <dlfcn.h>
#include <math.h>

#include "fcsl/fcsl_sim.h"
#include "fuzz.h"
#include "plan/plan.h"

/* Plans that take long by what they say are left out: what they do is seen in shorter ones. */
#define RATE_MAX   20000u
#define STEP_MIN_S 1e-5

enum { TICKS = 20, VALUES = 64, TEXT_BYTES = 4096 };

int LLVMFuzzerInitialize(int *argc, char ***argv);

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    /* Never closed, so that an input does not load them anew. */
    FUZZ_CHECK(dlopen("./hopper.so", RTLD_NOW) != NULL && dlopen("./ramp.so", RTLD_NOW) != NULL &&
               dlopen("./noisy_sensor.so", RTLD_NOW) != NULL && dlopen("./ball.so", RTLD_NOW) != NULL &&
               dlopen("./problem.so", RTLD_NOW) != NULL);
    return 0;
}

static int takes_long(const char *text, size_t size)
{
    fcsl_plan_t plan;
    fcsl_error_t error;
    int found = 0;
    if (fcsl_plan_parse(&plan, text, size, &error) == 0) {
        for (uint32_t i = 0; i < plan.group_count; i++) {
            found = found || plan.groups[i].hz > RATE_MAX ||
                    (plan.groups[i].hz == 0 && plan.groups[i].min_step_s < STEP_MIN_S);
        }
        for (uint32_t i = 0; i < plan.instance_count; i++) {
            found = found || (plan.instances[i].hz > 0 && plan.instances[i].hz / plan.instances[i].every > RATE_MAX);
        }
    }
    fcsl_plan_free(&plan);
    return found;
}

static void read_truth(const fcsl_sim_t *sim)
{
    uint8_t cdr[TEXT_BYTES];
    double values[VALUES];
    (void)fcsl_sim_truth_values(sim, values, VALUES);
    for (uint32_t i = 0; i < fcsl_sim_instance_count(sim); i++) {
        FUZZ_CHECK(fcsl_sim_model_message_type(sim, i)[0] != '\0' && fcsl_sim_model_message_schema(sim, i)[0] != '\0');
        FUZZ_CHECK(fcsl_sim_model_message(sim, i, cdr, sizeof cdr) <= (int64_t)sizeof cdr);
    }
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {{0}};
    size_t length = size;
    char *plan = (char *)take_copy(&bytes, &length);
    if (takes_long(plan, length)) {
        free(plan);
        return 0;
    }
    fcsl_sim_t *sim = fcsl_sim_open(plan, length, NULL, &error);
    free(plan);
    FUZZ_CHECK((sim == NULL) == (error.text[0] != '\0'));
    if (sim == NULL) {
        return 0;
    }
    int64_t done = 0;
    for (int i = 0; i < TICKS && done >= 0 && fcsl_sim_status(sim) == FCSL_SIM_RUNNING; i++) {
        done = fcsl_sim_run(sim, 1, &error);
        FUZZ_CHECK(done <= 1);
        read_truth(sim);
    }
    FUZZ_CHECK(fcsl_sim_tick(sim) <= fcsl_sim_ticks(sim));
    FUZZ_CHECK(fcsl_sim_close(sim, &error) == 0);
    return 0;
}
