/* SPDX-License-Identifier: Apache-2.0 */
#include "timing.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

double now_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

double median(double *values, int count)
{
    qsort(values, (size_t)count, sizeof *values, by_value);
    return values[count / 2];
}

spread_t spread(double *values, int count)
{
    const double middle = median(values, count);
    return (spread_t){.median = middle, .low = values[count / 4], .high = values[count - 1 - count / 4]};
}

const fcsl_machine_t *load_machine(const char *library)
{
    void *handle = dlopen(library, RTLD_NOW | RTLD_LOCAL);
    const fcsl_machine_t *const *machines =
        handle != NULL ? (const fcsl_machine_t *const *)dlsym(handle, "fcsl_machines") : NULL;
    if (machines == NULL || machines[0] == NULL) {
        fprintf(stderr, "bench: %s: %s\n", library, dlerror());
        exit(1);
    }
    return machines[0];
}

void *new_machine(const fcsl_machine_t *machine)
{
    void *data = aligned_alloc(64, (machine->size + 63u) / 64u * 64u);
    if (data == NULL) {
        fprintf(stderr, "bench: out of memory\n");
        exit(1);
    }
    machine->init(data);
    if (machine->start(data) != 0) {
        fprintf(stderr, "bench: start of %s failed\n", machine->name);
        exit(1);
    }
    return data;
}

uint32_t offset_of(const fcsl_machine_t *machine, const char *path)
{
    for (uint32_t i = 0; machine->fields != NULL && i < machine->field_count; ++i) {
        if (strcmp(machine->fields[i].path, path) == 0) {
            return machine->fields[i].offset;
        }
    }
    for (uint32_t i = 0; machine->fields == NULL && i < machine->instance_count; ++i) {
        const fcsl_folded_instance_t *one = &machine->folded->instances[i];
        const fcsl_fold_t *fold = &machine->folded->folds[one->fold];
        const size_t name = strlen(machine->instances[i].name);
        for (uint32_t j = 0; strncmp(machine->instances[i].name, path, name) == 0 && j < fold->field_count; ++j) {
            if (strcmp(fold->fields[j].path, path + name) == 0) {
                return one->offset + fold->fields[j].offset;
            }
        }
    }
    fprintf(stderr, "bench: %s has no field %s\n", machine->name, path);
    exit(1);
}

void *allocate(size_t size)
{
    void *memory = malloc(size);
    if (memory == NULL) {
        fprintf(stderr, "bench: no memory\n");
        exit(1);
    }
    return memory;
}
