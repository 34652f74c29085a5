/* SPDX-License-Identifier: Apache-2.0
 *
 * Flies the compiled lander in the kernel's strict seccomp mode: a system call other than read, write and exit kills the
 * process. Usage: strict LIBRARY TICKS CLOCK
 *   CLOCK   none      no instance is timed
 *           counter   each reading of the clock is one more, computed here
 *           kernel    each reading is a system call: the control
 * Prints tick and names of the states flown. Exits with 77 where this mode cannot be had.
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <inttypes.h>
#include <linux/seccomp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#include "fcsl/fcsl_machine.h"

enum { CANNOT = 77 };

static uint64_t count_up(void *ctx)
{
    return ++*(uint64_t *)ctx;
}

static uint64_t ask_the_kernel(void *ctx)
{
    (void)ctx;
    return (uint64_t)syscall(SYS_getppid);
}

/* exit() and _exit() end all threads, which is another system call. */
static _Noreturn void leave(int status)
{
    for (;;) {
        (void)syscall(SYS_exit, status);
    }
}

static double *field(const fcsl_machine_t *machine, unsigned char *data, const char *path)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        if (strcmp(machine->fields[i].path, path) == 0) {
            return (double *)(void *)(data + machine->fields[i].offset);
        }
    }
    (void)fprintf(stderr, "strict: the machine has no field %s\n", path);
    exit(1);
}

static const fcsl_machine_t *load(const char *path)
{
    void *library = dlopen(path, RTLD_NOW);
    const fcsl_machine_t *const *machines =
        library ? (const fcsl_machine_t *const *)dlsym(library, "fcsl_machines") : NULL;
    if (machines == NULL) {
        (void)fprintf(stderr, "strict: %s\n", dlerror());
        exit(1);
    }
    return machines[0];
}

/* `ticks` ticks against a point mass that always weighs 500 kg; returns the states it was in, as bits. */
static uint32_t fly(const fcsl_machine_t *machine, unsigned char *data, const fcsl_host_t *host, long ticks,
                    double *const fields[3])
{
    double height = 0.0;
    double speed = 0.0;
    uint32_t flown = 0;
    for (long k = 0; k < ticks; k++) {
        *fields[0] = height;
        *fields[1] = speed;
        machine->step(data, host);
        int32_t state = 0;
        memcpy(&state, data + machine->state_offset, sizeof state);
        flown |= UINT32_C(1) << state;
        speed += (*fields[2] * 2000.0 / 500.0 - 1.62) / 100.0;
        height += speed / 100.0;
        if (height < 0.0) {
            height = 0.0;
            speed = 0.0;
        }
    }
    return flown;
}

static void report(const fcsl_machine_t *machine, const unsigned char *data, uint32_t flown)
{
    char text[512];
    uint64_t tick = 0;
    memcpy(&tick, data + machine->tick_offset, sizeof tick);
    int length = snprintf(text, sizeof text, "%" PRIu64, tick);
    for (uint32_t i = 0; i < machine->state_count && length > 0 && (size_t)length < sizeof text; i++) {
        if ((flown >> i & 1u) != 0) {
            length += snprintf(text + length, sizeof text - (size_t)length, " %s", machine->states[i].name);
        }
    }
    if (length <= 0 || (size_t)length >= sizeof text || write(STDOUT_FILENO, text, (size_t)length) != length) {
        leave(1);
    }
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        (void)fprintf(stderr, "usage: strict LIBRARY TICKS CLOCK\n");
        return 2;
    }
    const fcsl_machine_t *machine = load(argv[1]);
    const long ticks = strtol(argv[2], NULL, 10);
    unsigned char *data = aligned_alloc(64, (machine->size + 63u) / 64u * 64u);
    if (data == NULL) {
        return 1;
    }
    double *const fields[3] = {field(machine, data, "sensors.outputs.pos_z"),
                               field(machine, data, "sensors.outputs.vel_z"),
                               field(machine, data, "engine.outputs.throttle")};
    uint64_t counter = 0;
    fcsl_host_t host = {.ctx = &counter};
    if (strcmp(argv[3], "none") != 0) {
        host.clock_ns = strcmp(argv[3], "kernel") == 0 ? ask_the_kernel : count_up;
    }
    if (prctl(PR_SET_SECCOMP, SECCOMP_MODE_STRICT) != 0) {
        return CANNOT;
    }
    if (machine->init(data) != 0) {
        leave(1);
    }
    report(machine, data, fly(machine, data, &host, ticks, fields));
    leave(0);
}
