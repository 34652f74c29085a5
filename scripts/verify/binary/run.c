/* SPDX-License-Identifier: Apache-2.0
 *
 * A compiled machine on a painted stack and with an allocator that counts, through init and many ticks of the stimulus.
 * Usage: binary_run LIBRARY MACHINE TICKS SEED free|strict
 *   free    compares the floating-point environment and the signal mask before and after, too
 *   strict  in the kernel's strict seccomp mode: a system call other than read, write and exit kills the process
 * Prints `name value` lines: start (what it returned; unless 0, no tick runs), ticks, states and visited (states), init_bytes, start_bytes and
 * step_bytes (of stack), allocations (calls), environment and signals (1: as before). Exits with 77 where the kernel does not offer the strict mode.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fenv.h>
#include <inttypes.h>
#include <linux/seccomp.h>
#include <signal.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "counted.h"
#include "painted.h"
#include "stimulus.h"

enum { WRONG_USE = 2, CANNOT = 77, LINE_BYTES = 64, MAX_STATES = 1024, ALIGNMENT = 64 };

static _Noreturn void fail(const char *what)
{
    (void)fprintf(stderr, "binary_run: %s\n", what);
    exit(1);
}

/* exit() and _exit() end all threads, which is another system call than strict mode allows. */
static _Noreturn void leave(int status)
{
    for (;;) {
        (void)syscall(SYS_exit, status);
    }
}

static const fcsl_machine_t *load(const char *path, const char *name)
{
    void *library = dlopen(path, RTLD_NOW);
    const fcsl_machine_t *const *machines =
        library != NULL ? (const fcsl_machine_t *const *)dlsym(library, "fcsl_machines") : NULL;
    if (machines == NULL) {
        fail(dlerror());
    }
    while (*machines != NULL && strcmp((*machines)->name, name) != 0) {
        machines++;
    }
    if (*machines == NULL) {
        fail("the library has no such machine");
    }
    return *machines;
}

static void print(const char *name, uint64_t value)
{
    char text[LINE_BYTES];
    const int length = snprintf(text, sizeof text, "%s %" PRIu64 "\n", name, value);
    if (length <= 0 || length >= LINE_BYTES || write(STDOUT_FILENO, text, (size_t)length) != length) {
        leave(1);
    }
}

/* What says how floats are computed: rounding, exceptions that trap, subnormals; not the flags that results leave behind. */
typedef struct {
    uint32_t sse;
    uint16_t x87;
    uint16_t x87_registers; /* all ones: none is in use */
} environment_t;

static environment_t environment(void)
{
    const uint32_t sse_flags = 0x3f;
    fenv_t found;
    if (fegetenv(&found) != 0) {
        leave(1);
    }
    return (environment_t){found.__mxcsr & ~sse_flags, found.__control_word, found.__tags};
}

static uint64_t on_painted_stack(const void *function, void *machine, const fcsl_host_t *host)
{
    const uint64_t integers[4] = {(uint64_t)(uintptr_t)machine, (uint64_t)(uintptr_t)host};
    const double reals[3] = {0};
    return painted_call(function, integers, reals);
}

/* Runs the ticks; returns how many different states they were in. */
static uint32_t fly(const fcsl_machine_t *d, void *machine, uint64_t ticks, uint64_t seed)
{
    static bool visited[MAX_STATES];
    uint32_t count = 0;
    stimulus_host_t host;
    stimulus_host_begin(&host, seed);
    stimulus_begin(d, machine);
    for (uint64_t tick = 0; tick < ticks; tick++) {
        host.tick = tick;
        stimulus_tick(d, machine, tick, seed);
        (void)on_painted_stack((const void *)d->step, machine, &host.host);
        int32_t state = 0;
        memcpy(&state, (const char *)machine + d->state_offset, sizeof state);
        if (state < 0 || (uint32_t)state >= d->state_count) {
            leave(1);
        }
        count += visited[state] ? 0u : 1u;
        visited[state] = true;
    }
    return count;
}

/* Flies, with everything watched; prints what was seen. */
static void watch(const fcsl_machine_t *d, void *machine, uint64_t ticks, uint64_t seed)
{
    const environment_t before = environment();
    painted_begin();
    counted_armed = true;
    (void)on_painted_stack((const void *)d->init, machine, NULL);
    const size_t init_bytes = painted_used();
    painted_begin();
    const uint64_t failed = on_painted_stack((const void *)d->start, machine, NULL);
    const size_t start_bytes = painted_used();
    painted_begin();
    const uint32_t visited = (uint32_t)failed == 0u ? fly(d, machine, ticks, seed) : 0u;
    counted_armed = false;
    const environment_t after = environment();
    print("start", (uint32_t)failed);
    print("ticks", (uint32_t)failed == 0u ? ticks : 0u);
    print("states", d->state_count);
    print("visited", visited);
    print("init_bytes", init_bytes);
    print("start_bytes", start_bytes);
    print("step_bytes", painted_used());
    print("allocations", counted_calls);
    print("environment", memcmp(&before, &after, sizeof before) == 0);
}

int main(int argc, char **argv)
{
    if (argc != 6) {
        (void)fprintf(stderr, "usage: binary_run LIBRARY MACHINE TICKS SEED free|strict\n");
        return WRONG_USE;
    }
    const fcsl_machine_t *d = load(argv[1], argv[2]);
    const uint64_t ticks = strtoull(argv[3], NULL, 10);
    const uint64_t seed = strtoull(argv[4], NULL, 10);
    void *machine = aligned_alloc(ALIGNMENT, (d->size + ALIGNMENT - 1u) / ALIGNMENT * ALIGNMENT);
    if (machine == NULL || d->state_count > MAX_STATES) {
        fail("no memory, or too many states");
    }
    if (strcmp(argv[5], "strict") == 0) {
        if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
            return CANNOT;
        }
        watch(d, machine, ticks, seed);
        leave(0);
    }
    sigset_t before;
    sigset_t after;
    (void)sigemptyset(&before);
    after = before;
    if (sigprocmask(SIG_BLOCK, NULL, &before) != 0) {
        fail("no signal mask");
    }
    watch(d, machine, ticks, seed);
    if (sigprocmask(SIG_BLOCK, NULL, &after) != 0) {
        fail("no signal mask");
    }
    print("signals", memcmp(&before, &after, sizeof before) == 0);
    return 0;
}
