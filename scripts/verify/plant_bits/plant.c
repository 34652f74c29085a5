/* SPDX-License-Identifier: Apache-2.0
 *
 * Flies a plan of the simulator and writes every value at every tick.
 *
 *     plant values PLAN RUNS   8 bytes for each scalar of all instances, then of the machine; RUNS times in this process. The
 *                              number of ticks of each run is a line on standard error.
 *     plant names PLAN         a line for each of these scalars
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_sim.h"

enum { PLAN_BYTES = 1 << 20, WORD_BYTES = 8 };

static char plan[PLAN_BYTES];

static int fail(const char *what)
{
    (void)fprintf(stderr, "plant: %s\n", what);
    return 1;
}

/* NaNs are one value, whatever their sign and payload. */
static void put_values(const fcsl_field_t *fields, uint32_t count, const uint8_t *data)
{
    for (uint32_t i = 0; i < count; i++) {
        const uint32_t size = fcsl_scalar_size(fields[i].type);
        for (uint32_t k = 0; k < fields[i].count; k++) {
            uint8_t word[WORD_BYTES] = {0};
            fcsl_scalars_export(word, data + fields[i].offset + (size_t)k * size, fields[i].type, 1);
            (void)fwrite(word, 1, sizeof word, stdout);
        }
    }
}

static void put_names(const fcsl_field_t *fields, uint32_t count, const char *instance)
{
    for (uint32_t i = 0; i < count; i++) {
        for (uint32_t k = 0; k < fields[i].count; k++) {
            (void)printf("%s%s%s[%u]\n", instance, instance[0] != '\0' ? "." : "", fields[i].path, k);
        }
    }
}

static void put(const fcsl_sim_t *sim, int names)
{
    const fcsl_machine_t *machine = fcsl_sim_machine(sim);
    for (uint32_t i = 0; i < fcsl_sim_instance_count(sim); i++) {
        const fcsl_model_t *model = fcsl_sim_instance_model(sim, i);
        if (names) {
            put_names(model->fields, model->field_count, fcsl_sim_instance_name(sim, i));
        } else {
            put_values(model->fields, model->field_count, fcsl_sim_instance_data(sim, i));
        }
    }
    if (names) {
        put_names(machine->fields, machine->field_count, "");
    } else {
        put_values(machine->fields, machine->field_count, fcsl_sim_machine_data(sim));
    }
}

static int fly(size_t size, int names)
{
    fcsl_error_t error = {{0}};
    fcsl_sim_t *sim = fcsl_sim_open(plan, size, NULL, &error);
    if (sim == NULL) {
        return fail(error.text);
    }
    if (names) {
        put(sim, 1);
        return fcsl_sim_close(sim, &error);
    }
    while (fcsl_sim_status(sim) == FCSL_SIM_RUNNING) {
        if (fcsl_sim_run(sim, 1, &error) != 1) {
            return fail(error.text);
        }
        put(sim, 0);
    }
    (void)fprintf(stderr, "%llu\n", (unsigned long long)fcsl_sim_tick(sim));
    return fcsl_sim_close(sim, &error) == 0 ? 0 : fail(error.text);
}

int main(int argc, char **argv)
{
    FILE *file = argc >= 3 ? fopen(argv[2], "rb") : NULL;
    if (file == NULL) {
        return fail("plant values|names PLAN [RUNS]");
    }
    const size_t size = fread(plan, 1, sizeof plan, file);
    (void)fclose(file);
    const int names = strcmp(argv[1], "names") == 0;
    const int runs = argc >= 4 ? atoi(argv[3]) : 1;
    int status = 0;
    for (int i = 0; i < runs && status == 0; i++) {
        status = fly(size, names);
    }
    return fflush(stdout) == 0 ? status : fail("cannot write");
}
