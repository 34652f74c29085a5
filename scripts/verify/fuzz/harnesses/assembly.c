/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_sim.h: plans that hold together but for a few places. Each decision takes a byte: below 208 it is the right one, else one
 * of all that there are. So references, groups, calls, rates and tolerances of whole simulations are tried, which `simulation`
 * with its text seldom reaches. The same plan gives the same values twice, also from a checkpoint of the first one.
 */
#include <dlfcn.h>
#include <stdarg.h>

#include "fcsl/fcsl_sim.h"
#include "fuzz.h"

enum { INSTANCES_MAX = 6, TICKS = 6, VALUES = 64, TEXT_BYTES = 1 << 16, RIGHT = 208 };

int LLVMFuzzerInitialize(int *argc, char ***argv);

typedef struct {
    const char *name;
    const char *library;
    const char *input;     /* or "inputs.none" */
    const char *output;    /* f64, or another type */
    const char *parameter;
    int states;
    int outputs; /* it has `output` */
    int updates;
} kind_t;

static const kind_t kinds[] = {
    {"ball", "./ball.so", "inputs.push", "outputs.z", "parameters.height", 2, 1, 0},
    {"ramp", "./ramp.so", "inputs.rate", "outputs.seen_rate", "parameters.none", 1, 1, 0},
    {"noisy_sensor", "./noisy_sensor.so", "inputs.truth", "outputs.value", "parameters.sigma", 0, 0, 1},
    {"problem", "./problem.so", "inputs.none", "outputs.x", "parameters.x", 2, 1, 0},
    {"chain", "./chain.so", "inputs.u", "outputs.through", "parameters.gain", 1, 1, 0},
    {"serial_link", "./serial_link.so", "inputs.none", "outputs.frames", "parameters.reliable", 0, 0, 1},
    {"hopper", "./hopper.so", "inputs.none", "outputs.throttle", "parameters.none", 0, 0, 1}, /* a machine */
};
enum { KINDS = sizeof kinds / sizeof *kinds };

static const char *const names[INSTANCES_MAX + 1] = {"a", "b", "c", "d", "e", "f", "nobody"};
static const char *const methods[] = {"euler", "rk2", "rk4", "ab4", "verlet", "rk45", "rk9"};
static const char *const bits[] = {
    "0000000000000000", "3ff0000000000000", "bff0000000000000", "3eb0c6f7a0b5ed8d",
    "3f50624dd2f1a9fc", "0000000000000001", "7ff0000000000000", "7ff8000000000000",
    "7fefffffffffffff", "ffffffffffffffff", "40239eb851eb851f", "00000000ffffffff",
};
/* No step so small that a tick takes long. */
static const char *const steps[] = {"3f1a36e2eb1c432d", "3f50624dd2f1a9fc", "3fb999999999999a", "7e37e43c8800759c"};
static const char *const fields[] = {
    "inputs.push", "inputs.rate",       "inputs.truth",       "outputs.z",       "outputs.bounces",
    "outputs.x",   "outputs.value",     "outputs.sampled",    "outputs.time_ns", "outputs.nested.twice",
    "state.z",     "parameters.height", "parameters.dropout", "parameters.p",    "nothing.at_all",
};
static const char *const channels[] = {"altitude", "velocity", "throttle", "nobody"};
static const uint32_t rates[] = {100, 50, 1000, 7, 0, 10000};
#define PICK(table, right) ((table)[choose(plan, (right), sizeof(table) / sizeof *(table))])

typedef struct {
    bytes_t bytes;
    char text[TEXT_BYTES];
    size_t used;
    const kind_t *kind[INSTANCES_MAX];
    uint32_t count;
    int with_companion;
} plan_t;

int LLVMFuzzerInitialize(int *argc, char ***argv)
{
    (void)argc;
    (void)argv;
    FUZZ_CHECK(dlopen("./hopper.so", RTLD_NOW) != NULL); /* never closed, so that an input does not load them anew */
    for (uint32_t i = 0; i < KINDS; i++) {
        FUZZ_CHECK(dlopen(kinds[i].library, RTLD_NOW) != NULL);
    }
    return 0;
}

/* `right`, or any number below `count`. */
static uint32_t choose(plan_t *plan, uint32_t right, uint32_t count)
{
    const uint32_t byte = (uint32_t)take_number(&plan->bytes, 1);
    return byte < RIGHT ? right : (uint32_t)take_number(&plan->bytes, 1) % count;
}

static uint32_t any(plan_t *plan, uint32_t count)
{
    return (uint32_t)take_number(&plan->bytes, 1) % count;
}

__attribute__((format(printf, 2, 3))) static void say(plan_t *plan, const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    const int length = vsnprintf(plan->text + plan->used, TEXT_BYTES - plan->used, format, arguments);
    va_end(arguments);
    FUZZ_CHECK(length > 0 && plan->used + (size_t)length < TEXT_BYTES);
    plan->used += (size_t)length;
}

/* Group 0 is adaptive, 1 has any method of fixed steps, and 2 integrates by Verlet; or another one. */
static void say_groups(plan_t *plan)
{
    const uint32_t method = any(plan, 4);
    say(plan, "group %s 0 %s %s %s %s\n", PICK(methods, 5), PICK(bits, 3), PICK(bits, 3), PICK(steps, 0),
        PICK(steps, 1));
    say(plan, "group %s %u %s %s %s %s\n", PICK(methods, method), PICK(rates, 2), bits[0], bits[0], bits[0], bits[0]);
    say(plan, "group %s 100 %s %s %s %s\n", PICK(methods, 4), bits[0], bits[0], bits[0], bits[0]);
}

static void say_instances(plan_t *plan)
{
    static const char *const groups[] = {"0", "1", "2", "-", "3"};
    for (uint32_t i = 0; i < plan->count; i++) {
        const kind_t *kind = &kinds[any(plan, KINDS)];
        const uint32_t group = kind->outputs ? any(plan, strcmp(kind->name, "problem") == 0 ? 3 : 2) : 3;
        const int updates = choose(plan, (uint32_t)kind->updates, 2) != 0;
        plan->kind[i] = kind;
        say(plan, "instance %s %s %s %u %u %u\n", names[choose(plan, i, INSTANCES_MAX)], kind->name,
            PICK(groups, group), updates ? rates[any(plan, 3)] : 0u, updates ? 1u + any(plan, 3) : 0u,
            updates ? any(plan, 4) : 0u);
    }
}

static void say_order(plan_t *plan)
{
    static const char *const calls[] = {"output", "stage", "update"};
    for (uint32_t i = 0; i < plan->count; i++) {
        const uint32_t right = plan->kind[i]->updates ? 2u : any(plan, 2);
        if (choose(plan, 1, 2) != 0) {
            say(plan, "call %s %s\n", PICK(names, i), PICK(calls, right));
        }
        if (plan->kind[i]->states > 0 && any(plan, 2) != 0) {
            say(plan, "tolerance %s %u %s\n", PICK(names, i), choose(plan, 0, 4) * 777u, PICK(bits, 3));
        }
    }
}

static void say_values(plan_t *plan)
{
    for (uint32_t n = any(plan, 8); n > 0; n--) {
        const uint32_t i = any(plan, plan->count);
        const char *field = choose(plan, 1, 2) != 0 ? plan->kind[i]->parameter : fields[any(plan, 15)];
        say(plan, "set %s %s %u %s\n", PICK(names, i), field, choose(plan, 0, 4), bits[any(plan, 12)]);
    }
    for (uint32_t n = any(plan, 4); n > 0; n--) {
        const uint32_t i = any(plan, plan->count);
        const char *field = choose(plan, 1, 2) != 0 ? plan->kind[i]->input : fields[any(plan, 15)];
        say(plan, "event %u %s %s %u %s\n", any(plan, 8) * 7500000u, PICK(names, i), field, choose(plan, 0, 4),
            bits[any(plan, 12)]);
    }
}

static void say_connections(plan_t *plan)
{
    for (uint32_t n = any(plan, 6); n > 0; n--) {
        const uint32_t from = any(plan, plan->count);
        const uint32_t to = any(plan, plan->count);
        const char *output = choose(plan, 1, 2) != 0 ? plan->kind[from]->output : fields[any(plan, 15)];
        const char *input = choose(plan, 1, 2) != 0 ? plan->kind[to]->input : fields[any(plan, 15)];
        say(plan, "link %s %s %s %s\n", PICK(names, from), output, PICK(names, to), input);
    }
    for (uint32_t n = any(plan, 3); n > 0; n--) {
        const uint32_t from = any(plan, plan->count);
        say(plan, "sensor %s %s %s\n", PICK(names, from), plan->kind[from]->output, PICK(channels, n - 1u));
    }
    for (uint32_t n = any(plan, 3); n > 0; n--) {
        const uint32_t to = any(plan, plan->count);
        say(plan, "actuator %s %s %s\n", PICK(channels, 2), PICK(names, to), plan->kind[to]->input);
    }
}

/* With a companion, and with the machine's own fields. */
static void say_others(plan_t *plan)
{
    const uint32_t how = any(plan, 4);
    plan->with_companion = how > 1;
    if (how > 0) {
        say(plan, "delay %u\n", any(plan, 4));
    }
    if (plan->with_companion) {
        say(plan, "companion %s %u hopper %s\n", how > 2 ? "second" : names[0], any(plan, 3), kinds[KINDS - 1].library);
    }
}

static void say_fields(plan_t *plan)
{
    static const char *const machine[] = {"pilot.outputs.throttle", "pilot.outputs.pos_z", "pilot.outputs.health",
                                          "machine.tick", "pilot.inputs.none"};
    const uint32_t i = any(plan, plan->count);
    const uint32_t how = any(plan, 8);
    if (plan->with_companion && (how & 1u) != 0) {
        say(plan, "companion_sensor %s %s second %s\n", PICK(names, i), plan->kind[i]->output, PICK(channels, 0));
        say(plan, "companion_actuator second %s %s %s\n", PICK(channels, 2), PICK(names, i), plan->kind[i]->input);
    }
    if ((how & 2u) != 0) {
        say(plan, "read %s %s %s\n", PICK(machine, 0), PICK(names, i), plan->kind[i]->input);
    }
    if ((how & 4u) != 0) {
        say(plan, "write %s %s %s\n", PICK(names, i), plan->kind[i]->output, PICK(machine, 1));
    }
}

static void say_end(plan_t *plan)
{
    static const char *const comparisons[] = {"==", ">", "<", "in"};
    if (any(plan, 4) == 3) {
        say(plan, "serial_link %s\n", names[any(plan, INSTANCES_MAX + 1)]);
    }
    if (any(plan, 4) == 3) {
        const uint32_t i = any(plan, plan->count);
        say(plan, "until 1 %s.%s %s %u\n", PICK(names, i), plan->kind[i]->output, PICK(comparisons, 1), any(plan, 12));
    }
    say(plan, "end\n");
}

static void say_all(plan_t *plan)
{
    plan->count = 1u + any(plan, INSTANCES_MAX);
    say(plan, "fcsl-sim-plan 3\nmachine hopper ./hopper.so\nseed 1\nticks %u\n", 1u + choose(plan, 99, TICKS));
    say_others(plan);
    for (uint32_t i = 0; i < KINDS; i++) {
        const char *keyword = strcmp(kinds[i].name, "hopper") == 0 ? "machine_model" : "model";
        say(plan, "%s %s %s\n", keyword, kinds[i].name, kinds[choose(plan, i, KINDS)].library);
    }
    say_groups(plan);
    say_instances(plan);
    say_order(plan);
    say_values(plan);
    say_connections(plan);
    say_fields(plan);
    say_end(plan);
}

/* Whether a tick was done. */
static int step(fcsl_sim_t *sim, fcsl_error_t *error)
{
    return fcsl_sim_status(sim) == FCSL_SIM_RUNNING && fcsl_sim_run(sim, 1, error) == 1;
}

static void expect_equal(const fcsl_sim_t *sim, const fcsl_sim_t *other)
{
    double values[2][VALUES] = {{0}};
    FUZZ_CHECK(fcsl_sim_tick(sim) == fcsl_sim_tick(other) && fcsl_sim_tick(sim) <= fcsl_sim_ticks(sim));
    const uint32_t count = fcsl_sim_truth_values(sim, values[0], VALUES);
    FUZZ_CHECK(fcsl_sim_truth_values(other, values[1], VALUES) == count);
    for (uint32_t i = 0; i < count && i < VALUES; i++) {
        if (memcmp(&values[0][i], &values[1][i], sizeof values[0][i]) != 0) {
            (void)fprintf(stderr, "output %u: %a, and %a again\n", i, values[0][i], values[1][i]);
            FUZZ_CHECK(!"the same plan has the same values");
        }
    }
}

static void fly(fcsl_sim_t *sim, fcsl_sim_t *other)
{
    fcsl_error_t error = {{0}};
    fcsl_error_t again = {{0}};
    int goes_on = 1;
    for (int i = 0; i < TICKS / 2 && goes_on; i++) {
        goes_on = step(sim, &error);
    }
    void *checkpoint = goes_on ? malloc(fcsl_sim_checkpoint_capacity(sim)) : NULL;
    const size_t size = goes_on ? fcsl_sim_checkpoint(sim, checkpoint) : 0;
    const int restored = goes_on && fcsl_sim_restore_checkpoint(other, checkpoint, size, &again) == 0;
    if (goes_on && !restored && strstr(again.text, "serial link") == NULL) {
        (void)fprintf(stderr, "%s\n", again.text);
        FUZZ_CHECK(!"what was saved is restored");
    }
    free(checkpoint);
    for (int i = 0; i < TICKS / 2 && !restored; i++) {
        (void)step(other, &again);
    }
    expect_equal(sim, other);
    for (int i = 0; i < TICKS / 2 && goes_on; i++) {
        goes_on = step(sim, &error);
        FUZZ_CHECK(step(other, &again) == goes_on);
        expect_equal(sim, other);
    }
    FUZZ_CHECK(strcmp(error.text, again.text) == 0 || again.text[0] != '\0');
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    plan_t *plan = calloc(1, sizeof *plan);
    FUZZ_CHECK(plan != NULL);
    plan->bytes = (bytes_t){data, size};
    say_all(plan);
    fcsl_error_t error = {{0}};
    fcsl_sim_t *sim = fcsl_sim_open(plan->text, plan->used, NULL, &error);
    FUZZ_CHECK((sim == NULL) == (error.text[0] != '\0'));
    if (getenv("FUZZ_SHOW") != NULL) {
        (void)fprintf(stderr, "%s%s\n", plan->text, error.text);
    }
    if (sim != NULL) {
        fcsl_sim_t *other = fcsl_sim_open(plan->text, plan->used, NULL, &error);
        FUZZ_CHECK(other != NULL);
        fly(sim, other);
        FUZZ_CHECK(fcsl_sim_close(other, &error) == 0);
        FUZZ_CHECK(fcsl_sim_close(sim, &error) == 0);
    }
    free(plan);
    return 0;
}
