/* SPDX-License-Identifier: Apache-2.0
 *
 * Real-time priority, locked memory and a processor of its own for the step thread.
 */
#define _GNU_SOURCE
#include "realtime.h"

#include <errno.h>
#include <pthread.h>
#include <sched.h>
#include <stdio.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include "fcsl/fcsl_error.h"

/* Touched ahead of time; what a step needs is printed by the build and lies far below. */
enum { STACK_BYTES = 512 * 1024 };
/* Of other threads when memory is locked: the usual 8 MiB each would be locked whole. */
enum { THREAD_STACK_BYTES = 512 * 1024, TEXT_BYTES = 128 };

static int take_priority(int priority, fcsl_error_t *error)
{
    const struct sched_param parameters = {.sched_priority = priority};
    if (sched_setscheduler(0, SCHED_FIFO | SCHED_RESET_ON_FORK, &parameters) == 0) {
        return 0;
    }
    struct rlimit limit = {0};
    if (errno == EPERM && getrlimit(RLIMIT_RTPRIO, &limit) == 0 && limit.rlim_cur < (rlim_t)priority) {
        return fcsl_fail(
            error,
            "--realtime-priority %d is not allowed here (the limit is %llu): run as root, give the program the "
            "capability (`setcap cap_sys_nice=ep` on it), or raise `rtprio` in /etc/security/limits.conf",
            priority, (unsigned long long)limit.rlim_cur);
    }
    if (errno == EPERM) {
        return fcsl_fail(error,
                         "--realtime-priority %d: this control group has no real-time budget; move the program to "
                         "the root group, or give its group cpu.rt_runtime_us",
                         priority);
    }
    return fcsl_fail(error, "--realtime-priority %d: %s", priority, strerror(errno));
}

static int lock_memory(int flags, fcsl_error_t *error)
{
    if (mlockall(flags) == 0) {
        return 0;
    }
    const int reason = errno;
    struct rlimit limit = {0};
    if ((reason == EPERM || reason == ENOMEM || reason == EAGAIN) && getrlimit(RLIMIT_MEMLOCK, &limit) == 0 &&
        limit.rlim_cur != RLIM_INFINITY) {
        return fcsl_fail(
            error,
            "--lock-memory needs more than the %llu KiB that may be locked here: run as root, give the program "
            "the capability (`setcap cap_ipc_lock=ep` on it), or raise `memlock` in /etc/security/limits.conf "
            "(`ulimit -l unlimited`)",
            (unsigned long long)limit.rlim_cur / 1024u);
    }
    return fcsl_fail(error, "--lock-memory: %s", strerror(reason));
}

/* The processors as the kernel writes them, "0-3,6". */
static void list_cpus(const cpu_set_t *cpus, char *text, size_t capacity)
{
    size_t length = 0;
    text[0] = '\0';
    for (int first = 0; first < CPU_SETSIZE && length + 16 < capacity; first++) {
        if (CPU_ISSET((size_t)first, cpus)) {
            int last = first;
            while (last + 1 < CPU_SETSIZE && CPU_ISSET((size_t)last + 1u, cpus)) {
                last++;
            }
            const char *comma = length > 0 ? "," : "";
            length +=
                (size_t)(first == last ? snprintf(text + length, capacity - length, "%s%d", comma, first)
                                       : snprintf(text + length, capacity - length, "%s%d-%d", comma, first, last));
            first = last;
        }
    }
}

/* Leaves processor `cpu` to the step thread: threads that are started from here on run on the others. */
static int leave_cpu(int cpu, fcsl_error_t *error)
{
    char text[TEXT_BYTES];
    cpu_set_t cpus;
    if (sched_getaffinity(0, sizeof cpus, &cpus) != 0) {
        return fcsl_fail(error, "--cpu %d: %s", cpu, strerror(errno));
    }
    list_cpus(&cpus, text, sizeof text);
    if (cpu >= CPU_SETSIZE || !CPU_ISSET((size_t)cpu, &cpus)) {
        return fcsl_fail(error, "--cpu %d: this program may run on %s only; see `taskset -p` and its control group",
                         cpu, text);
    }
    CPU_CLR((size_t)cpu, &cpus);
    if (CPU_COUNT(&cpus) == 0) {
        return fcsl_fail(
            error, "--cpu %d: it is the only processor this program may run on, and other threads need one, too", cpu);
    }
    return sched_setaffinity(0, sizeof cpus, &cpus) == 0 ? 0 : fcsl_fail(error, "--cpu %d: %s", cpu, strerror(errno));
}

/* touch_stack needs room on top of what the program uses already. */
static int check_stack(fcsl_error_t *error)
{
    struct rlimit limit;
    if (getrlimit(RLIMIT_STACK, &limit) != 0) {
        return fcsl_fail(error, "--lock-memory: the limit of the stack: %s", strerror(errno));
    }
    return limit.rlim_cur >= 2u * STACK_BYTES
               ? 0
               : fcsl_fail(error, "--lock-memory touches %d KiB of the stack, which may have %llu KiB: `ulimit -s %d`",
                           STACK_BYTES / 1024, (unsigned long long)limit.rlim_cur / 1024u, 2 * STACK_BYTES / 1024);
}

static int limit_thread_stacks(fcsl_error_t *error)
{
    pthread_attr_t attributes;
    int code = pthread_attr_init(&attributes);
    if (code == 0) {
        code = pthread_attr_setstacksize(&attributes, THREAD_STACK_BYTES);
        code = code == 0 ? pthread_setattr_default_np(&attributes) : code;
        (void)pthread_attr_destroy(&attributes);
    }
    return code == 0 ? 0 : fcsl_fail(error, "--lock-memory: the stacks of threads: %s", strerror(code));
}

/* Before memory is locked: a locked stack that must grow beyond the limit is a SIGSEGV, and mlockall says ENOMEM. */
__attribute__((noinline)) static void touch_stack(void)
{
    volatile char stack[STACK_BYTES];
    for (size_t i = 0; i < sizeof stack; i += 1024) {
        stack[i] = 0;
    }
}

int realtime_begin(const realtime_t *realtime, fcsl_error_t *error)
{
    if (realtime->priority > 0 && take_priority(realtime->priority, error) != 0) {
        return -1;
    }
    if (realtime->cpu >= 0 && leave_cpu(realtime->cpu, error) != 0) {
        return -1;
    }
    if (!realtime->lock_memory) {
        return 0;
    }
    if (check_stack(error) != 0) {
        return -1;
    }
    touch_stack();
    return lock_memory(MCL_CURRENT, error) == 0 ? limit_thread_stacks(error) : -1;
}

int realtime_enter(const realtime_t *realtime, fcsl_error_t *error)
{
    /* Without real-time scheduling the kernel may delay a wake-up by 50 us to save another; not here. */
    (void)prctl(PR_SET_TIMERSLACK, 1uL);
    if (realtime->cpu >= 0) {
        cpu_set_t own;
        CPU_ZERO(&own);
        CPU_SET((size_t)realtime->cpu, &own);
        if (sched_setaffinity(0, sizeof own, &own) != 0) {
            return fcsl_fail(error, "--cpu %d: %s", realtime->cpu, strerror(errno));
        }
    }
    return realtime->lock_memory ? lock_memory(MCL_CURRENT | MCL_FUTURE, error) : 0;
}
