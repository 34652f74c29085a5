/* SPDX-License-Identifier: Apache-2.0
 *
 * Runs a plan to its end: steady_sim PLAN. After the first ten ticks the kernel ends it at any system call but write and exit, and
 * allocations are counted. Prints their number.
 */
#define _GNU_SOURCE
#include <linux/seccomp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fcsl/fcsl_sim.h"
#include "fcsl_allocations.h"

enum { PLAN_BYTES = 1 << 20, FIRST_TICKS = 10, CANNOT = 77 };

static void leave(int status, const char *text)
{
    (void)!write(STDOUT_FILENO, text, strlen(text));
    (void)syscall(SYS_exit, status);
}

int main(int argc, char **argv)
{
    static char plan[PLAN_BYTES];
    char text[64];
    fcsl_error_t error;
    FILE *file = argc == 2 ? fopen(argv[1], "rb") : NULL;
    const size_t size = file ? fread(plan, 1, sizeof plan, file) : 0;
    fcsl_sim_t *sim = size > 0 ? fcsl_sim_open(plan, size, NULL, &error) : NULL;
    if (!sim || fcsl_sim_run(sim, FIRST_TICKS, &error) < 0) {
        (void)fprintf(stderr, "%s\n", error.text);
        return 1;
    }
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
        return CANNOT;
    }
    counting = 1;
    while (fcsl_sim_status(sim) == FCSL_SIM_RUNNING) {
        if (fcsl_sim_run(sim, 1000, &error) < 0) {
            leave(1, error.text);
        }
    }
    counting = 0;
    (void)snprintf(text, sizeof text, "%llu allocations\n", (unsigned long long)allocations);
    leave(0, text);
}
