/* SPDX-License-Identifier: Apache-2.0
 *
 * Preloaded into fcsl-fc (test_fc_steady.py): watches the step thread from its sleep number STEADY_FROM to number STEADY_TO.
 * Meanwhile the kernel lets it make no system call but the absolute sleep, reading the clock, waking a thread (futex, the 8
 * bytes of an eventfd) and sched_yield; its allocations are counted. Then the process ends and prints a line with the result.
 * With STEADY_PEER set, it may also wait for its peer (ppoll), send and receive without waiting, take 8 bytes of an eventfd, and
 * take the lock that it shares with the thread of a wire; its waits for the peer count as sleeps.
 * x86-64 and aarch64 Linux.
 */
#define _GNU_SOURCE
#include <linux/audit.h>
#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <sys/syscall.h>
#include <time.h>
#include <unistd.h>

#include "fcsl_allocations.h"

enum { FORBIDDEN = 90, CANNOT = 77, LOOK_NS = 2000000 };

/* What the step thread tells the thread that may speak. */
static atomic_int forbidden_call = -1;
static atomic_int over;
static atomic_uint_fast64_t sleeps;

#define ARGUMENT(n)       ((uint32_t)(offsetof(struct seccomp_data, args) + 8u * (n))) /* its low half */
#define LOAD(offset)      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, offset)
#define UNLESS(value, to) BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, value, 0, to)
#define ALLOW             BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW)
#define TRAP              BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP)

/* A call that is allowed; one that is if argument n is `value`, or has one of `bits`. */
#define CALL(call)                UNLESS(call, 1), ALLOW
#define CALL_WITH(call, n, value) UNLESS(call, 4), LOAD(ARGUMENT(n)), UNLESS(value, 1), ALLOW, TRAP
#define CALL_WITH_BIT(call, n, bits)                                                                                   \
    UNLESS(call, 4), LOAD(ARGUMENT(n)), BPF_JUMP(BPF_JMP | BPF_JSET | BPF_K, bits, 0, 1), ALLOW, TRAP

/* From here on this thread makes no call but these. */
static int watch_calls(struct sock_filter *code, size_t length)
{
    const struct sock_fprog program = {.len = (unsigned short)length, .filter = code};
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
           syscall(SYS_seccomp, SECCOMP_SET_MODE_FILTER, 0, &program) == 0;
}

/* What a thread may do that waits for its peer. */
static int watch_with_peer(void)
{
    struct sock_filter code[] = {
        LOAD(offsetof(struct seccomp_data, nr)),
        CALL(SYS_clock_gettime),
        CALL(SYS_sched_yield),
        CALL(SYS_ppoll),
        CALL(SYS_futex),
        CALL(SYS_clock_nanosleep), /* the shape of its sleep is watched without a peer */
        CALL_WITH_BIT(SYS_recvfrom, 3, MSG_DONTWAIT),
        CALL_WITH_BIT(SYS_sendto, 3, MSG_DONTWAIT),
        CALL_WITH(SYS_read, 2, 8),
        CALL_WITH(SYS_write, 2, 8),
        TRAP,
    };
    return watch_calls(code, sizeof code / sizeof code[0]);
}

static int watch_without_peer(void)
{
    struct sock_filter code[] = {
        LOAD(offsetof(struct seccomp_data, nr)),
        CALL(SYS_clock_gettime),
        CALL(SYS_sched_yield),
        UNLESS(SYS_clock_nanosleep, 6), /* on the monotonic clock, to an absolute time */
        LOAD(ARGUMENT(0)),
        UNLESS(CLOCK_MONOTONIC, 3),
        LOAD(ARGUMENT(1)),
        UNLESS(TIMER_ABSTIME, 1),
        ALLOW,
        TRAP,
        CALL_WITH(SYS_futex, 1, FUTEX_WAKE | FUTEX_PRIVATE_FLAG), /* that wakes */
        UNLESS(SYS_write, 6), /* to an eventfd: 8 bytes, no standard stream */
        LOAD(ARGUMENT(2)),
        UNLESS(8, 3),
        LOAD(ARGUMENT(0)),
        BPF_JUMP(BPF_JMP | BPF_JGT | BPF_K, 2, 0, 1),
        ALLOW,
        TRAP,
        TRAP,
    };
    return watch_calls(code, sizeof code / sizeof code[0]);
}

/* From here on this thread may not even end: the other one ends the process. */
static void on_forbidden(int number, siginfo_t *info, void *context)
{
    (void)number;
    (void)context;
    atomic_store(&forbidden_call, info->si_syscall);
    for (;;) {
    }
}

static unsigned long faults_of_main(void)
{
    char path[64];
    unsigned long minor = 0;
    unsigned long major = 0;
    (void)snprintf(path, sizeof path, "/proc/self/task/%d/stat", (int)getpid());
    FILE *file = fopen(path, "r");
    if (file == NULL || fscanf(file, "%*d (%*[^)]) %*c %*d %*d %*d %*d %*d %*u %lu %*u %lu", &minor, &major) != 2) {
        _exit(CANNOT);
    }
    (void)fclose(file);
    return minor + major;
}

static atomic_ulong faults_before;
static uint64_t seen_allocations;

static void *speak(void *argument)
{
    (void)argument;
    const struct timespec nap = {.tv_nsec = LOOK_NS};
    while (!atomic_load(&over) && atomic_load(&forbidden_call) < 0) {
        (void)nanosleep(&nap, NULL);
    }
    const int call = atomic_load(&forbidden_call);
    if (call >= 0) {
        (void)printf("steady: the step thread made system call %d\n", call);
    } else {
        (void)printf("steady: %llu sleeps, %llu allocations, %lu page faults\n",
                     (unsigned long long)atomic_load(&sleeps), (unsigned long long)seen_allocations,
                     faults_of_main() - atomic_load(&faults_before));
    }
    (void)fflush(stdout);
    _exit(call >= 0 ? FORBIDDEN : 0);
}

static unsigned long number_from(const char *name)
{
    const char *text = getenv(name);
    return text != NULL ? strtoul(text, NULL, 10) : 0;
}

static void begin(void)
{
    pthread_t thread;
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_forbidden;
    action.sa_flags = SA_SIGINFO;
    if (sigaction(SIGSYS, &action, NULL) != 0 || pthread_create(&thread, NULL, speak, NULL) != 0) {
        _exit(CANNOT);
    }
    atomic_store(&faults_before, faults_of_main());
    if (!(getenv("STEADY_PEER") != NULL ? watch_with_peer() : watch_without_peer())) {
        _exit(CANNOT);
    }
    allocations = 0;
    counting = 1;
}

static void end(void)
{
    counting = 0;
    seen_allocations = allocations;
    atomic_store(&over, 1);
    for (;;) {
    }
}

static pthread_t main_thread;

__attribute__((constructor)) static void note_main_thread(void)
{
    main_thread = pthread_self();
}

/* Of the step thread. */
static void sleep_begins(void)
{
    static unsigned long from;
    static unsigned long to;
    const uint64_t number = atomic_fetch_add(&sleeps, 1) + 1u;
    if (from == 0) {
        from = number_from("STEADY_FROM");
        to = number_from("STEADY_TO");
    }
    if (number == from) {
        begin();
    } else if (number == to) {
        end();
    }
}

/* The step thread's sleep; it alone calls this in fcsl-fc. */
int clock_nanosleep(clockid_t clock, int flags, const struct timespec *time, struct timespec *left)
{
    if (flags == TIMER_ABSTIME) {
        sleep_begins();
    }
    return (int)syscall(SYS_clock_nanosleep, clock, flags, time, left);
}

/* Its wait for the peer; the threads of wires call this, too. The kernel writes what is left of the time. */
int ppoll(struct pollfd *entries, nfds_t count, const struct timespec *time, const sigset_t *mask)
{
    struct timespec left = time != NULL ? *time : (struct timespec){0};
    if (pthread_equal(pthread_self(), main_thread) && getenv("STEADY_PEER") != NULL) {
        sleep_begins();
    }
    return (int)syscall(SYS_ppoll, entries, count, time != NULL ? &left : NULL, mask, 8);
}
