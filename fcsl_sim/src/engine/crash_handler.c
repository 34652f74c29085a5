/* SPDX-License-Identifier: Apache-2.0
 *
 * Where a simulation is, for whoever finds that it crashes or hangs.
 */
#define _GNU_SOURCE
#include "crash_handler.h"

#include <sched.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fcsl/fcsl_sim.h"
#include "base/clock.h"
#include "fcsl/fcsl_error.h"

enum { STACK_BYTES = 1 << 16, TEXT_BYTES = 1024, EXIT_FAILED = 2 };

static const int SIGNALS[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
static const char *const SIGNAL_NAMES[] = {"SIGSEGV", "SIGBUS", "SIGFPE", "SIGILL", "SIGABRT"};
#define SIGNAL_COUNT (sizeof SIGNALS / sizeof *SIGNALS)
static const char *const FUNCTIONS[] = {"", "init", "derivative", "output", "update", "event", "reset", "next_time"};

/* The plant of the simulation that was opened last, since the handlers are those of the process. */
static const fcsl_plant_t *_Atomic current;
/* Threads that look into it: it is not freed meanwhile. */
static _Atomic uint32_t readers;
static volatile sig_atomic_t as_json;
static struct sigaction previous[SIGNAL_COUNT];
static int watching;

void fcsl_sim_is_open(const fcsl_plant_t *plant, int is_open)
{
    const fcsl_plant_t *before = plant;
    if (is_open) {
        atomic_store(&current, plant);
    } else {
        (void)atomic_compare_exchange_strong(&current, &before, NULL);
        while (atomic_load(&readers) > 0) {
            (void)sched_yield();
        }
    }
}

static void read_call(const fcsl_plant_t *plant, fcsl_sim_running_call_t *at)
{
    const uint64_t call = atomic_load_explicit(&plant->running_call, memory_order_relaxed);
    const uint32_t instance = (uint32_t)(call >> 8) & 0xffffu;
    const uint32_t number = (uint32_t)(call & 0xffu);
    at->entry = call;
    at->function = FUNCTIONS[number < sizeof FUNCTIONS / sizeof *FUNCTIONS ? number : 0];
    at->time_ns = plant->time_ns;
    const char *name =
        number != FCSL_IN_NONE && instance < plant->instance_count ? plant->instances[instance].name : "";
    for (uint32_t i = 0; name[i] && i + 1u < sizeof at->instance; i++) {
        at->instance[i] = name[i];
    }
}

int fcsl_sim_running_call(fcsl_sim_running_call_t *at)
{
    *at = (fcsl_sim_running_call_t){.function = ""};
    (void)atomic_fetch_add(&readers, 1u);
    const fcsl_plant_t *plant = atomic_load(&current);
    if (plant) {
        read_call(plant, at);
    }
    (void)atomic_fetch_sub(&readers, 1u);
    return at->instance[0] != '\0';
}

/* Text without the C library's printf, which a crash may have interrupted. */
typedef struct {
    char text[TEXT_BYTES];
    size_t used;
} line_t;

static void put(line_t *line, const char *text)
{
    while (*text && line->used < sizeof line->text) {
        line->text[line->used++] = *text++;
    }
}

static void put_digits(line_t *line, uint64_t value, uint32_t digits)
{
    char text[24] = "";
    char *at = text + sizeof text - 1;
    for (uint32_t i = 0; i < digits || value > 0; i++, value /= 10u) {
        *--at = (char)('0' + value % 10u);
    }
    put(line, at);
}

static void put_crash(line_t *line, int number, const fcsl_sim_running_call_t *at)
{
    put(line, "`");
    put(line, at->function);
    put(line, "` of `");
    put(line, at->instance);
    put(line, "` crashed at ");
    put_digits(line, (uint64_t)at->time_ns / FCSL_NS_PER_S, 1);
    put(line, ".");
    put_digits(line, (uint64_t)at->time_ns % FCSL_NS_PER_S, 9);
    put(line, " s: ");
    for (uint32_t i = 0; i < SIGNAL_COUNT; i++) {
        put(line, SIGNALS[i] == number ? SIGNAL_NAMES[i] : "");
    }
}

/* The handlers before ours, such as those of Python's faulthandler. */
static int give_back(void)
{
    int failed = 0;
    for (uint32_t i = 0; i < SIGNAL_COUNT; i++) {
        failed = sigaction(SIGNALS[i], &previous[i], NULL) != 0 || failed;
    }
    return failed ? -1 : 0;
}

static void handle(int number)
{
    fcsl_sim_running_call_t at;
    if (!fcsl_sim_running_call(&at)) { /* no model runs: as if nobody watched */
        (void)give_back();
        (void)raise(number);
        return;
    }
    line_t message = {.used = 0};
    line_t json = {.used = 0};
    put(&message, "fcsl-sim: error: ");
    put_crash(&message, number, &at);
    put(&message, "\n");
    put(&json, "{\"end\": \"error\", \"error\": \"");
    put_crash(&json, number, &at);
    put(&json, "\"}\n");
    ssize_t written = write(STDERR_FILENO, message.text, message.used);
    if (as_json) {
        written = write(STDOUT_FILENO, json.text, json.used);
    }
    (void)written; /* there is nobody else to tell */
    _exit(EXIT_FAILED);
}

static int take(fcsl_error_t *error)
{
    static uint8_t *stack;
    if (!stack) {
        stack = malloc(STACK_BYTES); /* for ever: a handler may run on it */
    }
    const stack_t alternate = {.ss_sp = stack, .ss_size = STACK_BYTES};
    if (!stack || sigaltstack(&alternate, NULL) != 0) {
        return fcsl_fail(error, "no memory for the handler of crashes");
    }
    struct sigaction action = {.sa_handler = handle, .sa_flags = SA_ONSTACK};
    (void)sigemptyset(&action.sa_mask);
    for (uint32_t i = 0; i < SIGNAL_COUNT; i++) {
        if (sigaction(SIGNALS[i], &action, &previous[i]) != 0) {
            return fcsl_fail(error, "the handler of crashes cannot be installed");
        }
    }
    watching = 1;
    return 0;
}

int fcsl_sim_watch_crashes(int watch, int json, fcsl_error_t *error)
{
    as_json = json;
    if (watch && !watching) {
        return take(error);
    }
    if (!watch && watching) {
        watching = 0;
        return give_back() == 0 ? 0 : fcsl_fail(error, "the handlers before cannot be installed again");
    }
    return 0;
}
