/* SPDX-License-Identifier: Apache-2.0
 *
 * What it costs to save a machine and to restore it, in process:
 *   checkpoint LIBRARY ROUNDS     ns of fcsl_run_save + fcsl_run_restore (the machine struct), of a plain copy there and back,
 *                                 and of fcsl_run_checkpoint + fcsl_run_restore_checkpoint (a file's bytes), in turns
 * Prints JSON.
 */
#include "timing.h"

#include <fcsl/fcsl_run.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { REPEATS = 200, WORKS = 3 };

typedef struct {
    fcsl_run_t *run;
    uint8_t *bytes;
    uint8_t *copy;
    uint32_t size;
} subject_t;

static void need(int status, const fcsl_error_t *error)
{
    if (status != 0) {
        fprintf(stderr, "checkpoint: %s\n", error->text);
        exit(1);
    }
}

static void of_struct(const subject_t *s)
{
    fcsl_error_t error = {""};
    need(fcsl_run_save(s->run, s->bytes, s->size, &error), &error);
    need(fcsl_run_restore(s->run, s->bytes, s->size, &error), &error);
}

static void of_copy(const subject_t *s)
{
    memcpy(s->bytes, s->copy, s->size);
    __asm__ volatile("" ::: "memory");
    memcpy(s->copy, s->bytes, s->size);
    __asm__ volatile("" ::: "memory");
}

static void of_file(const subject_t *s)
{
    fcsl_error_t error = {""};
    const size_t size = fcsl_run_checkpoint(s->run, s->bytes);
    need(fcsl_run_restore_checkpoint(s->run, s->bytes, size, 0, &error), &error);
}

int main(int argc, char **argv)
{
    static void (*const works[WORKS])(const subject_t *) = {of_struct, of_copy, of_file};
    static const char *const names[WORKS] = {"struct", "copy", "file"};
    if (argc != 3) {
        fprintf(stderr, "usage: checkpoint LIBRARY ROUNDS\n");
        return 2;
    }
    const int rounds = atoi(argv[2]);
    fcsl_error_t error = {""};
    subject_t s = {.run = fcsl_run_open(argv[1], NULL, NULL, &error)};
    need(s.run != NULL ? 0 : -1, &error);
    need(fcsl_run_step(s.run, 100, &error), &error);
    s.size = fcsl_run_machine(s.run)->size;
    s.bytes = allocate(fcsl_run_checkpoint_capacity(s.run));
    s.copy = allocate(s.size);
    memset(s.copy, 0, s.size);
    double *times[WORKS];
    for (int w = 0; w < WORKS; w++) {
        times[w] = allocate((size_t)rounds * sizeof **times);
    }
    for (int i = 0; i < rounds; i++) {
        for (int w = 0; w < WORKS; w++) {
            const double begun = now_ns();
            for (int n = 0; n < REPEATS; n++) {
                works[w](&s);
            }
            times[w][i] = (now_ns() - begun) / REPEATS;
        }
    }
    printf("{\"bytes\": %u", s.size);
    for (int w = 0; w < WORKS; w++) {
        const spread_t found = spread(times[w], rounds);
        printf(", \"%s_ns\": %.1f, \"%s_low_ns\": %.1f, \"%s_high_ns\": %.1f", names[w], found.median, names[w],
               found.low, names[w], found.high);
    }
    printf("}\n");
    return fcsl_run_close(s.run, &error) == 0 ? 0 : 1;
}
