/* SPDX-License-Identifier: Apache-2.0
 *
 * Instructions of every step of a machine under the stimulus: a line "state own all" per tick, then a line with its address for
 * every instruction of the machine that was reached. The file KINDS has lines
 * "address bytes kind" (of stepped.h) for a program that is loaded where it was linked; SCENE has lines "field element value"
 * (f64), written on every other tick over what the stimulus wrote.
 *
 *     stepped_machine TICKS SEED KINDS SCENE
 */
#include "stepped.h"
#include "stimulus.h"

#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_SCENE = 64 };

typedef struct {
    uint32_t offset;
    double value;
} write_t;

/* Returns 0, or 2 when the file is not what it should be. */
static int read_kinds(FILE *file)
{
    uint64_t address = 0;
    uint32_t size = 0;
    uint8_t kind = 0;
    while (fscanf(file, "%" SCNu64 " %" SCNu32 " %" SCNu8, &address, &size, &kind) == 3) {
        if (stepped.begin == 0) {
            stepped.begin = address; /* the file is in the order of addresses */
        }
        if (address - stepped.begin + size > STEPPED_MOST_BYTES) {
            return 2;
        }
        memset(&stepped.kinds[address - stepped.begin], kind, size);
    }
    return stepped.begin == 0 ? 2 : 0;
}

/* Returns how many writes there are, or -1. */
static int read_scene(const fcsl_machine_t *d, FILE *file, write_t *scene)
{
    char path[256];
    uint32_t element = 0;
    double value = 0;
    int count = 0;
    while (fscanf(file, "%255s %" SCNu32 " %lf", path, &element, &value) == 3) {
        const fcsl_field_t *found = NULL;
        for (uint32_t i = 0; i < d->field_count; i++) {
            found = strcmp(d->fields[i].path, path) == 0 ? &d->fields[i] : found;
        }
        if (found == NULL || found->type != FCSL_F64 || element >= found->count || count == MOST_SCENE) {
            fprintf(stderr, "stepped_machine: no element %" PRIu32 " of an f64 field `%s`\n", element, path);
            return -1;
        }
        scene[count++] = (write_t){found->offset + element * (uint32_t)sizeof(double), value};
    }
    return count;
}

int main(int argc, char **argv)
{
    if (argc != 5) {
        fprintf(stderr, "usage: stepped_machine TICKS SEED KINDS SCENE\n");
        return 2;
    }
    const uint64_t ticks = strtoull(argv[1], NULL, 10);
    const uint64_t seed = strtoull(argv[2], NULL, 10);
    const fcsl_machine_t *d = fcsl_machines[0];
    write_t scene[MOST_SCENE];
    FILE *kinds = fopen(argv[3], "r");
    FILE *file = fopen(argv[4], "r");
    if (kinds == NULL || file == NULL || read_kinds(kinds) != 0 || stepped_begin() != 0) {
        fprintf(stderr, "stepped_machine: cannot read `%s` and `%s`, or cannot trap\n", argv[3], argv[4]);
        return 2;
    }
    const int writes = read_scene(d, file, scene);
    if (writes < 0) {
        return 2;
    }
    fclose(kinds);
    fclose(file);
    uint8_t *machine = calloc(1, d->size);
    if (machine == NULL) {
        return 3;
    }
    d->init(machine);
    if (d->start(machine) != 0) {
        free(machine);
        return 3; /* a start that faults: nothing to count */
    }
    stimulus_begin(d, machine);
    static stimulus_host_t host;
    stimulus_host_begin(&host, seed);
    for (uint64_t tick = 0; tick < ticks; tick++) {
        host.tick = tick;
        stimulus_tick(d, machine, tick, seed);
        if (tick % 4u == 2u) { /* every state in turn, whatever the machine would rather do */
            d->force_state(machine, (int32_t)(tick / 4u % d->state_count));
        }
        for (int i = 0; i < writes && tick % 2u == 1u; i++) {
            memcpy(machine + scene[i].offset, &scene[i].value, sizeof scene[i].value);
        }
        stepped_arm((uintptr_t)d->step);
        d->step(machine, &host.host);
        int32_t state = 0;
        memcpy(&state, machine + d->state_offset, sizeof state);
        printf("%" PRId32 " %" PRIu64 " %" PRIu64 "\n", state, stepped.own, stepped.all);
    }
    free(machine);
    for (size_t i = 0; i < STEPPED_MOST_BYTES; i++) {
        if (stepped.reached[i] != 0) {
            printf("%" PRIuPTR "\n", stepped.begin + i);
        }
    }
    return 0;
}
