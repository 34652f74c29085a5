/* SPDX-License-Identifier: Apache-2.0
 *
 * Times kernels (kernel.h) side by side:
 *   timing INPUTS PER_STEP ROUNDS LIBRARY...        INPUTS: a file of doubles, PER_STEP for each step
 * Rounds of the kernels alternate, so that whatever else the machine does hits all of them. Prints JSON: of every kernel the
 * median of ns per step, and its result after the inputs went through once.
 */
#include "kernel.h"

#include <dlfcn.h>
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

enum { MAX_KERNELS = 16, MAX_ROUNDS = 10001 };

typedef struct {
    void (*reset)(void);
    void (*run)(const double *, long);
    void (*result)(double *);
    double ns[MAX_ROUNDS];
} kernel_t;

static kernel_t kernels[MAX_KERNELS];

static void fail(const char *what)
{
    fprintf(stderr, "timing: %s\n", what);
    exit(1);
}

static void *symbol(void *library, const char *name)
{
    void *found = dlsym(library, name);
    if (found == NULL) {
        fail(dlerror());
    }
    return found;
}

static void load(kernel_t *k, const char *path)
{
    void *library = dlopen(path, RTLD_NOW | RTLD_LOCAL);
    if (library == NULL) {
        fail(dlerror());
    }
    *(void **)&k->reset = symbol(library, "kernel_reset");
    *(void **)&k->run = symbol(library, "kernel_run");
    *(void **)&k->result = symbol(library, "kernel_result");
}

static double *read_inputs(const char *path, long *count)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) {
        fail("no inputs");
    }
    *count = ftell(file) / (long)sizeof(double);
    rewind(file);
    double *values = malloc((size_t)*count * sizeof *values);
    if (values == NULL || fread(values, sizeof *values, (size_t)*count, file) != (size_t)*count) {
        fail("inputs cannot be read");
    }
    fclose(file);
    return values;
}

/* Time of this thread: what else runs on the machine takes its turns in the midst of rounds. */
static double cpu_ns(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e9 + (double)t.tv_nsec;
}

static int by_value(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static void print(const char *path, kernel_t *k, int rounds)
{
    double result[KERNEL_RESULTS] = {0};
    k->result(result);
    qsort(k->ns, (size_t)rounds, sizeof k->ns[0], by_value);
    printf("{\"library\": \"%s\", \"ns\": %.3f, \"result\": [", path, k->ns[rounds / 2]);
    for (int i = 0; i < KERNEL_RESULTS; ++i) {
        printf("%s%.17g", i == 0 ? "" : ", ", result[i]);
    }
    printf("]}");
}

int main(int argc, char **argv)
{
    if (argc < 5 || argc - 4 > MAX_KERNELS) {
        fail("usage: timing INPUTS PER_STEP ROUNDS LIBRARY...");
    }
    long count = 0;
    const double *inputs = read_inputs(argv[1], &count);
    long steps = count / atol(argv[2]);
    int rounds = atoi(argv[3]);
    if (steps < 1 || rounds < 1 || rounds > MAX_ROUNDS) {
        fail("no steps, or too many rounds");
    }
    for (int i = 4; i < argc; ++i) {
        load(&kernels[i - 4], argv[i]);
    }
    for (int round = 0; round < rounds; ++round) {
        for (int i = 0; i < argc - 4; ++i) {
            kernels[i].reset();
            double begun = cpu_ns();
            kernels[i].run(inputs, steps);
            kernels[i].ns[round] = (cpu_ns() - begun) / (double)steps;
        }
    }
    printf("[");
    for (int i = 0; i < argc - 4; ++i) {
        printf("%s", i == 0 ? "" : ",\n");
        print(argv[i + 4], &kernels[i], rounds);
    }
    printf("]\n");
    return 0;
}
