/* SPDX-License-Identifier: Apache-2.0
 *
 * What the timed programs of `make bench` share: a clock, medians, and the way to a machine through its library.
 */
#ifndef BENCH_TIMING_H
#define BENCH_TIMING_H

#include <fcsl/fcsl_machine.h>

/* Of the monotonic clock. */
double now_ns(void);

/* Sorts `values`. */
double median(double *values, int count);

/* A median, and the quartiles beside it: half of what was measured lies between them. */
typedef struct {
    double median, low, high;
} spread_t;

/* Sorts `values`. */
spread_t spread(double *values, int count);

/* The first machine of a library. Ends the program with a message when there is none. */
const fcsl_machine_t *load_machine(const char *library);

/* An initialised machine, aligned to a cache line. Ends the program with a message when init fails. */
void *new_machine(const fcsl_machine_t *machine);

/* Bytes from the start of the struct. Ends the program with a message when there is no such field. */
uint32_t offset_of(const fcsl_machine_t *machine, const char *path);

/* Memory, or the end of the program. */
void *allocate(size_t size);

#endif /* BENCH_TIMING_H */
