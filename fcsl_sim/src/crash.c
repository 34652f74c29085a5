/* SPDX-License-Identifier: Apache-2.0
 *
 * Where a simulation is, for whoever finds that it crashes or hangs.
 */
#define _GNU_SOURCE
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fail.h"
#include "sim_internal.h"

enum { STACK_BYTES = 1 << 16, TEXT_BYTES = 1024, EXIT_FAILED = 2 };

static const int SIGNALS[] = {SIGSEGV, SIGBUS, SIGFPE, SIGILL, SIGABRT};
static const char *const FUNCTIONS[] = {"", "init", "derivative", "output", "update", "event", "reset"};

/* The simulation that was opened last, since the handlers are those of the process. */
static const fcsl_sim_t *_Atomic current;
static volatile sig_atomic_t as_json;

void fcsl_sim_is_open(const fcsl_sim_t *sim, int is_open)
{
    const fcsl_sim_t *before = sim;
    if (is_open) {
        atomic_store(&current, sim);
    } else {
        (void)atomic_compare_exchange_strong(&current, &before, NULL);
    }
}

static const char *place_of(const fcsl_sim_t *sim, const char **function, uint64_t *entry)
{
    const uint64_t place = atomic_load_explicit(&sim->place, memory_order_relaxed);
    const uint32_t instance = (uint32_t)(place >> 8) & 0xffffu;
    const uint32_t number = (uint32_t)(place & 0xffu);
    *entry = place;
    *function = FUNCTIONS[number < sizeof FUNCTIONS / sizeof *FUNCTIONS ? number : 0];
    return number != FCSL_IN_NONE && instance < sim->instance_count ? sim->instances[instance].name : NULL;
}

const char *fcsl_sim_place(const char **function, uint64_t *entry, int64_t *time_ns)
{
    const fcsl_sim_t *sim = atomic_load(&current);
    const char *instance = sim ? place_of(sim, function, entry) : NULL;
    *time_ns = instance ? sim->time_ns : 0;
    return instance;
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

static void put_crash(line_t *line, int number, const char *instance, const char *function, int64_t time_ns)
{
    put(line, "`");
    put(line, function);
    put(line, "` of `");
    put(line, instance);
    put(line, "` crashed at ");
    put_digits(line, (uint64_t)time_ns / 1000000000u, 1);
    put(line, ".");
    put_digits(line, (uint64_t)time_ns % 1000000000u, 9);
    put(line, " s: SIG");
    put(line, sigabbrev_np(number));
}

static void handle(int number)
{
    const char *function = "";
    uint64_t entry = 0;
    int64_t time_ns = 0;
    const char *instance = fcsl_sim_place(&function, &entry, &time_ns);
    if (!instance) { /* no model runs: as if nobody watched */
        (void)signal(number, SIG_DFL);
        (void)raise(number);
        return;
    }
    line_t message = {.used = 0};
    line_t json = {.used = 0};
    put(&message, "fcsl-sim: error: ");
    put_crash(&message, number, instance, function, time_ns);
    put(&message, "\n");
    put(&json, "{\"end\": \"error\", \"error\": \"");
    put_crash(&json, number, instance, function, time_ns);
    put(&json, "\"}\n");
    ssize_t written = write(STDERR_FILENO, message.text, message.used);
    if (as_json) {
        written = write(STDOUT_FILENO, json.text, json.used);
    }
    (void)written; /* there is nobody else to tell */
    _exit(EXIT_FAILED);
}

int fcsl_sim_watch_crashes(int watch, int json, fcsl_error_t *error)
{
    static uint8_t *stack;
    if (!stack) {
        stack = malloc(STACK_BYTES); /* for ever: a handler may run on it */
    }
    const stack_t alternate = {.ss_sp = stack, .ss_size = STACK_BYTES};
    if (!stack || sigaltstack(&alternate, NULL) != 0) {
        return fcsl_sim_fail(error, "no memory for the handler of crashes");
    }
    as_json = json;
    struct sigaction action = {.sa_handler = watch ? handle : SIG_DFL, .sa_flags = SA_ONSTACK};
    (void)sigemptyset(&action.sa_mask);
    for (uint32_t i = 0; i < sizeof SIGNALS / sizeof *SIGNALS; i++) {
        if (sigaction(SIGNALS[i], &action, NULL) != 0) {
            return fcsl_sim_fail(error, "the handler of crashes cannot be installed");
        }
    }
    return 0;
}
