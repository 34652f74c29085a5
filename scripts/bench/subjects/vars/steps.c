/* SPDX-License-Identifier: Apache-2.0
 *
 * Counts what a thread of another process executes, one instruction after the other, from one call of a function to the next:
 *
 *   vars_steps TID ADDRESS COUNT
 *
 * prints COUNT numbers, one per line: the instructions of the program (what the kernel does for it is not in it) between
 * two calls of the function at this address (hexadecimal). Only that thread is slowed down.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/user.h>
#include <sys/wait.h>

static int fail(const char *what)
{
    (void)fprintf(stderr, "vars_steps: %s: %s\n", what, strerror(errno));
    return 1;
}

int main(int argc, char **argv)
{
    const pid_t thread = argc == 4 ? atoi(argv[1]) : 0;
    const unsigned long long address = argc == 4 ? strtoull(argv[2], NULL, 16) : 0;
    const int wanted = argc == 4 ? atoi(argv[3]) : 0;
    int status = 0;
    if (thread <= 0 || address == 0 || wanted <= 0) {
        (void)fprintf(stderr, "usage: vars_steps TID ADDRESS COUNT\n");
        return 2;
    }
    if (ptrace(PTRACE_SEIZE, thread, NULL, NULL) != 0 || ptrace(PTRACE_INTERRUPT, thread, NULL, NULL) != 0 ||
        waitpid(thread, &status, __WALL) != thread) {
        return fail("cannot attach");
    }
    uint64_t instructions = 0;
    /* The first stretch began before this looked. */
    for (int told = -1; told < wanted; instructions++) {
        struct user_regs_struct registers;
        if (ptrace(PTRACE_GETREGS, thread, NULL, &registers) != 0) {
            return fail("cannot read registers");
        }
        if (registers.rip == address) {
            if (told >= 0) {
                (void)printf("%" PRIu64 "\n", instructions);
            }
            told++;
            instructions = 0;
        }
        if (ptrace(PTRACE_SINGLESTEP, thread, NULL, NULL) != 0 || waitpid(thread, &status, __WALL) != thread ||
            !WIFSTOPPED(status)) {
            return fail("the thread has ended");
        }
    }
    (void)ptrace(PTRACE_DETACH, thread, NULL, NULL);
    return 0;
}
