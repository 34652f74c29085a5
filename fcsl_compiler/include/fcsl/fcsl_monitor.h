/* SPDX-License-Identifier: Apache-2.0
 *
 * Monitors: the requirements of a machine, compiled to a machine of their own. After each tick a host copies the fields that
 * they name, and steps it (docs/guide/requirements.md). The machine that is watched is the same with and without it.
 */
#ifndef FCSL_MONITOR_H
#define FCSL_MONITOR_H

#include "fcsl/fcsl_machine.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef enum {
    FCSL_REQUIRED_THEN = 0, /* whenever `when` holds, a condition does */
    FCSL_REQUIRED_NEVER = 1, /* a condition never holds */
    FCSL_REQUIRED_AT_END = 2 /* a condition holds when the run ends */
} fcsl_required_t;

/* Its results are fields of the monitor's instance: outputs.holds (bool), .evaluated, .exercised, .undefined, but for
 * FCSL_REQUIRED_AT_END .violations, .violated_ticks (u64), .first_tick, .last_violated (i64), and of each value that it
 * reads .first_value_<n> and .last_value_<n>. */
typedef struct {
    const char *id; /* "LND-7" */
    const char *text;
    uint8_t kind; /* fcsl_required_t */
    uint8_t assumed; /* 1: it is about the environment, not about the machine */
    uint32_t instance; /* index into the monitor's instances */
    const char *source; /* the condition as it is written */
} fcsl_requirement_t;

/* A field of the machine, or one element of it, and the input of the monitor that has the same size. */
typedef struct {
    const char *path; /* "nav.outputs.position[2]" */
    const char *input; /* "lnd_7.inputs.value_0" */
} fcsl_observed_t;

typedef struct {
    const char *watched; /* name of the machine */
    const fcsl_machine_t *machine; /* the monitor, which has the same tick_hz */
    const fcsl_observed_t *observed;
    uint32_t observed_count;
    const fcsl_requirement_t *requirements;
    uint32_t requirement_count;
} fcsl_monitor_t;

/* Exported by a machine library in which a machine has requirements; ends with a null pointer. */
extern const fcsl_monitor_t *const fcsl_monitors[];

#ifdef __cplusplus
}
#endif

#endif /* FCSL_MONITOR_H */
