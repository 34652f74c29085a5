/* SPDX-License-Identifier: Apache-2.0
 *
 * The monitor of a run, for the files that step it, read its verdicts, record and save them.
 */
#ifndef FCSL_MONITOR_RUN_H
#define FCSL_MONITOR_RUN_H

#include "fcsl/fcsl_run.h"
#include "fcsl/fcsl_scalar.h"
#include "run_internal.h"

/* Bytes that go from the machine's struct into that of the monitor. */
typedef struct {
    uint32_t from;
    uint32_t to;
    uint32_t size; /* of a scalar: 1, 4 or 8 */
} fcsl_observed_copy_t;

/* Where the results of a requirement are in the monitor's struct; FCSL_NO_OFFSET: it has none such. */
typedef struct {
    uint32_t holds;
    uint32_t asked;
    uint32_t evaluated;
    uint32_t exercised;
    uint32_t undefined;
    uint32_t violations;
    uint32_t violated_ticks;
    uint32_t first_tick;
    uint32_t last_violated;
    uint32_t last_tick; /* of its memory: an i64 */
} fcsl_results_t;

/* The same, gathered: a window of a requirement may have many kilobytes, and observers read these alone. */
typedef struct {
    uint64_t evaluated;
    uint64_t exercised;
    uint64_t undefined;
    uint64_t faults;
    uint64_t violations;
    uint64_t violated_ticks;
    uint64_t first_tick;
    uint64_t last_tick;
    uint64_t forgot_before;
    uint8_t holds;
    uint8_t asked; /* whether `at_end` was asked for in the last evaluation, which did not fault */
} fcsl_served_row_t;

/* Where the monitor keeps a value of the first and of the last tick that violated a requirement. */
typedef struct {
    uint32_t first;
    uint32_t last;
} fcsl_kept_t;

struct fcsl_monitor_run {
    const fcsl_monitor_t *monitor;
    fcsl_run_t *run;
    fcsl_observed_copy_t *copied;
    fcsl_results_t *results;
    fcsl_served_row_t *rows; /* one for each requirement, and the kept values */
    fcsl_field_t *fields; /* of the rows, as they are served */
    char *paths;
    uint32_t field_count;
    fcsl_kept_t *kept;
    fcsl_field_t *kept_fields; /* the same, behind the rows, with paths and types of the machine that is watched */
    uint32_t *kept_begin;      /* for each requirement its first one, and behind the last requirement their number */
    fcsl_verdict_row_t *noted; /* for each requirement, and the kept values: what was recorded last */
    uint64_t forgot_before; /* the tick of the last restore that brought no memory of the requirements; 0: none */
    int is_noted; /* 0: nothing yet of this recording */
};

/* The scalar that a path names, and where it is; null where it names none. */
const fcsl_field_t *fcsl_monitor_locate(const fcsl_machine_t *machine, const char *path, uint32_t *offset);
/* Finds the kept values of all requirements; their arrays have room for `observed_count`. */
void fcsl_kept_bind(struct fcsl_monitor_run *made, const fcsl_machine_t *watched);
/* Copies those of a requirement behind the rows. */
void fcsl_kept_gather(const struct fcsl_monitor_run *made, uint32_t index);

static inline uint64_t fcsl_result_count(const uint8_t *data, uint32_t offset)
{
    return offset != FCSL_NO_OFFSET ? fcsl_read_u64(data, offset) : 0;
}

/* Whether `at_end` was asked for in the last evaluation of requirement `index`, which did not fault. */
static inline uint8_t fcsl_result_asked(const struct fcsl_monitor_run *made, const uint8_t *data, uint32_t index)
{
    const uint32_t asked = made->results[index].asked;
    const uint32_t instance = made->monitor->requirements[index].instance;
    return asked != FCSL_NO_OFFSET && data[asked] != 0 &&
           fcsl_read_i32(data, made->monitor->machine->instances[instance].health_offset) != FCSL_FAILED;
}

static inline uint8_t fcsl_verdict_status(const fcsl_requirement_t *requirement, uint8_t asked, uint8_t holds,
                                          uint64_t exercised, uint64_t violations)
{
    const int at_end = requirement->kind == FCSL_REQUIRED_AT_END;
    const int shown = at_end ? asked != 0 : exercised > 0;
    const int violated = at_end ? asked != 0 && !holds : violations > 0;
    return violated ? FCSL_VIOLATED : shown ? FCSL_MET : FCSL_NOT_EXERCISED;
}

#endif /* FCSL_MONITOR_RUN_H */
