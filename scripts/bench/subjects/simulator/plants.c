/* SPDX-License-Identifier: Apache-2.0
 *
 * Times a plant in the simulator against the same loop by hand:
 *   plants LIBFCSL_SIM PLANT PLAN ROUNDS
 * The plan has one instance and ticks once a second; a round is all of its seconds. The simulator, the loop by hand and the loop
 * with the derivative in a function of its own take turns, a second each, which is a thousand steps. Reported are medians and
 * quartiles over the seconds, so that whatever else runs spoils some of them. Prints JSON, with the last states, and whether
 * their bits agree.
 */
#include "plants_by_hand.h"
#include "timing.h"

#include <dlfcn.h>
#include <fcsl/fcsl_sim.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { STEPS = 1000, SECONDS_MAX = 10000 };

typedef struct {
    fcsl_sim_t *(*open)(const char *plan, size_t size, const fcsl_parameters_t *parameters, fcsl_error_t *error);
    int (*close)(fcsl_sim_t *sim, fcsl_error_t *error);
    int64_t (*run)(fcsl_sim_t *sim, uint64_t ticks, fcsl_error_t *error);
    uint64_t (*ticks)(const fcsl_sim_t *sim);
    void *(*data)(fcsl_sim_t *sim, uint32_t instance);
} simulator_t;

typedef struct {
    double *simulated, *by_hand, *apart, *ratio, *more;
    int count;
} times_t;

static void fail(const char *what, const char *why)
{
    fprintf(stderr, "bench: %s: %s\n", what, why);
    exit(1);
}

/* POSIX has functions in the pointers that dlsym returns; C does not convert those. */
static void find(void *library, const char *name, void *function)
{
    void *const found = library != NULL ? dlsym(library, name) : NULL;
    if (found == NULL) {
        fail(name, dlerror());
    }
    memcpy(function, &found, sizeof found);
}

static simulator_t load_simulator(const char *path)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    simulator_t simulator;
    find(library, "fcsl_sim_open", &simulator.open);
    find(library, "fcsl_sim_close", &simulator.close);
    find(library, "fcsl_sim_run", &simulator.run);
    find(library, "fcsl_sim_ticks", &simulator.ticks);
    find(library, "fcsl_sim_instance_data", &simulator.data);
    return simulator;
}

static const by_hand_plant_t *find_plant(const char *name)
{
    for (uint32_t i = 0; i < by_hand_count; i++) {
        if (strcmp(by_hand_plants[i].name, name) == 0) {
            return &by_hand_plants[i];
        }
    }
    fail(name, "no such plant");
    return NULL;
}

static char *read_text(const char *path, size_t *size)
{
    FILE *file = fopen(path, "rb");
    enum { MAX = 1 << 20 };
    char *text = allocate(MAX);
    if (file == NULL) {
        fail(path, "cannot be read");
    }
    *size = fread(text, 1, MAX, file);
    fclose(file);
    return text;
}

static void run_tick(const simulator_t *simulator, fcsl_sim_t *sim)
{
    fcsl_error_t error = {{0}};
    if (simulator->run(sim, 1, &error) != 1) {
        fail("simulator", error.text);
    }
}

/* One round. The structs are as they end in `simulated`, `by_hand` and `apart`. */
static void fly(const simulator_t *simulator, const by_hand_plant_t *plant, const char *plan, size_t size,
                times_t *times, void *simulated, void *by_hand, void *apart)
{
    fcsl_error_t error = {{0}};
    fcsl_sim_t *sim = simulator->open(plan, size, NULL, &error);
    if (sim == NULL) {
        fail("simulator", error.text);
    }
    if (simulator->ticks(sim) > SECONDS_MAX) {
        fail("plan", "too long");
    }
    run_tick(simulator, sim); /* tick 0: no time has passed */
    memcpy(by_hand, simulator->data(sim, 0), plant->size);
    memcpy(apart, simulator->data(sim, 0), plant->size);
    for (uint64_t second = 0; second + 1u < simulator->ticks(sim); second++) {
        double at[4];
        at[0] = now_ns();
        run_tick(simulator, sim);
        at[1] = now_ns();
        plant->run(by_hand, second * STEPS, STEPS);
        at[2] = now_ns();
        plant->run_apart(apart, second * STEPS, STEPS);
        at[3] = now_ns();
        times->simulated[times->count] = (at[1] - at[0]) / STEPS;
        times->by_hand[times->count] = (at[2] - at[1]) / STEPS;
        times->apart[times->count] = (at[3] - at[2]) / STEPS;
        times->ratio[times->count] = (at[1] - at[0]) / (at[2] - at[1]);
        times->more[times->count++] = (at[1] - at[0] - (at[2] - at[1])) / STEPS;
    }
    memcpy(simulated, simulator->data(sim, 0), plant->size);
    if (simulator->close(sim, &error) != 0) {
        fail("simulator", error.text);
    }
}

static void print_spread(const char *name, double *values, int count)
{
    const spread_t s = spread(values, count); /* sorts them */
    printf("\"%s\": %.6g, \"%s_low\": %.6g, \"%s_high\": %.6g, \"%s_best\": %.6g, ", name, s.median, name, s.low, name,
           s.high, name, values[0]);
}

static void print_states(const char *name, const double *x, uint32_t count)
{
    printf("\"%s\": [", name);
    for (uint32_t i = 0; i < count; i++) {
        printf("%s%.17g", i > 0 ? ", " : "", x[i]);
    }
    printf("], ");
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fail("usage", "plants LIBFCSL_SIM PLANT PLAN ROUNDS");
    }
    const simulator_t simulator = load_simulator(argv[1]);
    const by_hand_plant_t *plant = find_plant(argv[2]);
    const int rounds = atoi(argv[4]);
    size_t size;
    char *plan = read_text(argv[3], &size);
    const size_t bytes = (size_t)rounds * SECONDS_MAX * sizeof(double);
    times_t times = {allocate(bytes), allocate(bytes), allocate(bytes), allocate(bytes), allocate(bytes), 0};
    unsigned char *ends[3] = {allocate(plant->size), allocate(plant->size), allocate(plant->size)};
    for (int round = 0; round < rounds; round++) {
        fly(&simulator, plant, plan, size, &times, ends[0], ends[1], ends[2]);
    }
    const double *x[3];
    for (int i = 0; i < 3; i++) {
        x[i] = (const double *)(const void *)(ends[i] + plant->states);
    }
    const size_t state_bytes = plant->count * sizeof *x[0];
    printf("{");
    print_spread("simulated_ns", times.simulated, times.count);
    print_spread("by_hand_ns", times.by_hand, times.count);
    print_spread("apart_ns", times.apart, times.count);
    print_spread("ratio", times.ratio, times.count);
    print_spread("more_ns", times.more, times.count);
    print_states("simulated", x[0], plant->count);
    print_states("by_hand", x[1], plant->count);
    print_states("apart", x[2], plant->count);
    const int same = memcmp(x[0], x[1], state_bytes) == 0 && memcmp(x[1], x[2], state_bytes) == 0;
    printf("\"states\": %u, \"same_bits\": %s}\n", plant->count, same ? "true" : "false");
    return 0;
}
