/* SPDX-License-Identifier: Apache-2.0
 *
 * The thread that steps, while it posts, takes and waits: it allocates nothing, and makes no system call but to wake another
 * thread (8 bytes into an eventfd) and to wait for the peer (ppoll, and 8 bytes out of an eventfd). The kernel ends the process
 * at any other one.
 */
#define _GNU_SOURCE
#include <linux/filter.h>
#include <linux/seccomp.h>
#include <stddef.h>
#include <sys/prctl.h>
#include <sys/syscall.h>

#include "bus_rig.h"
#include "fcsl_allocations.h"

enum { ROUNDS = 2000, VALUES = 4, NO_FILTERS = 77 /* skipped */, ALLOCATES = 78 };

static const char *const KEYS[VALUES] = {"t/a", "t/b", "t/c", "t/d"};
static const char *const ANSWER[] = {"t/answer"};

#define LOAD(offset)      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offset)
#define UNLESS(value, to) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, to)
#define ALLOW             BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)
#define KILL              BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_KILL_PROCESS)
#define SIZE_ARGUMENT     (offsetof(struct seccomp_data, args) + 16u)

/* Of this thread alone. `waits`: ppoll and read are allowed, too. */
static void watch_calls(int waits)
{
    struct sock_filter code[] = {
        LOAD(offsetof(struct seccomp_data, nr)),
        UNLESS(SYS_clock_gettime, 1),
        ALLOW, /* where the vDSO cannot */
        UNLESS(SYS_exit_group, 1),
        ALLOW,
        UNLESS(waits ? SYS_ppoll : SYS_exit_group, 1),
        ALLOW,
        UNLESS(waits ? SYS_read : SYS_write, 2),
        LOAD(SIZE_ARGUMENT),
        BPF_JUMP(BPF_JMP | BPF_JA, 2, 0, 0),
        UNLESS(SYS_write, 3),
        LOAD(SIZE_ARGUMENT),
        UNLESS(8, 1),
        ALLOW,
        KILL,
    };
    const struct sock_fprog program = {.len = sizeof code / sizeof code[0], .filter = code};
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    (void)program; /* a sanitizer makes calls of its own; allocations are counted all the same */
    return;
#endif
    if (prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) != 0 || prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &program) != 0) {
        _exit(NO_FILTERS);
    }
}

static void answer(const char *endpoint)
{
    fcsl_bus_input_t inputs[VALUES];
    for (uint32_t i = 0; i < VALUES; i++) {
        inputs[i] = (fcsl_bus_input_t){.key = KEYS[i], .bytes = sizeof(uint64_t), .depth = 1};
    }
    inputs[VALUES - 1].depth = 2;
    const fcsl_bus_options_t options = {.role = FCSL_BUS_LISTEN,
                                        .endpoint = endpoint,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = ANSWER,
                                        .output_count = 1,
                                        .inputs = inputs,
                                        .input_count = VALUES};
    fcsl_bus_t *bus = open_bus(&options);
    for (;;) { /* until it is killed */
        uint64_t tick = 0;
        take_one(bus, VALUES - 1, &tick, sizeof tick);
        CHECK(fcsl_bus_post(bus, 0, &tick, sizeof tick) == 0);
    }
}

static void step(fcsl_bus_t *bus, uint64_t tick, int waits)
{
    uint64_t got = 0;
    size_t size = 0;
    fcsl_bus_counters_t counters;
    for (uint32_t i = 0; i < VALUES; i++) {
        CHECK(fcsl_bus_post(bus, i, &tick, sizeof tick) == 0);
    }
    const uint64_t deadline_ns = later_ns();
    while (!fcsl_bus_take(bus, 0, &got, &size)) {
        CHECK(fcsl_monotonic_ns() < deadline_ns);
        if (waits) {
            (void)fcsl_bus_wait(bus, deadline_ns);
        }
    }
    CHECK(got == tick && size == sizeof got && fcsl_bus_matched(bus, 0) && fcsl_bus_token_count(bus, 0) == 0);
    fcsl_bus_count(bus, &counters);
}

/* Ends the process: closing needs more of the kernel than this thread may have. */
static void run(int waits)
{
    const fcsl_bus_input_t inputs[] = {{.key = ANSWER[0], .bytes = sizeof(uint64_t), .depth = 1}};
    const char *endpoint = free_endpoint();
    (void)in_process(answer, endpoint);
    const fcsl_bus_options_t options = {.role = FCSL_BUS_CLIENT,
                                        .endpoint = endpoint,
                                        .timeout_ms = LONG_MS,
                                        .ring_bytes = RING_BYTES,
                                        .outputs = KEYS,
                                        .output_count = VALUES,
                                        .inputs = inputs,
                                        .input_count = 1};
    fcsl_bus_t *bus = open_bus(&options);
    WAIT_UNTIL(bus, fcsl_bus_matched(bus, 0) && fcsl_bus_matched(bus, VALUES - 1));
    step(bus, 0, 1);
    watch_calls(waits);
    counting = 1;
    for (uint64_t tick = 1; tick < ROUNDS; tick++) {
        step(bus, tick, waits);
    }
    counting = 0;
    _exit(allocations == 0 ? 0 : ALLOCATES);
}

static void test_waiting(void)
{
    run(1);
}

static void test_looking(void)
{
    run(0);
}

/* In a process of its own, whose status it returns. */
static int run_alone(void (*test)(void))
{
    int status = 0;
    const pid_t process = fork();
    CHECK(process >= 0);
    if (process == 0) {
        test();
    }
    CHECK(waitpid(process, &status, 0) == process);
    CHECK(WIFEXITED(status) && (WEXITSTATUS(status) == 0 || WEXITSTATUS(status) == NO_FILTERS));
    return WEXITSTATUS(status);
}

int main(void)
{
    const int waiting = run_alone(test_waiting);
    return waiting != 0 ? waiting : run_alone(test_looking);
}
