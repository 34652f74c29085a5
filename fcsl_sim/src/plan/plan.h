/* SPDX-License-Identifier: Apache-2.0
 *
 * The plan: the front end's input to the native simulator. Text, one statement per line, words separated by one space:
 *
 *   fcsl-sim-plan 3
 *   machine NAME LIBRARY                              library: to the end of the line
 *   seed N
 *   ticks N                                           controller ticks at the latest
 *   delay TICKS                                       of the machine's commands
 *   companion NAME DELAY MACHINE LIBRARY              a further controller; library: to the end of the line
 *   model NAME LIBRARY
 *   machine_model NAME LIBRARY                        a machine with one instance, as a model
 *   group METHOD HZ RTOL ATOL MIN_STEP MAX_STEP       by number, from 0; HZ 0: adaptive. The others are bits of doubles
 *   instance NAME MODEL GROUP HZ EVERY PHASE          GROUP -: in none; updates at steps PHASE + i * EVERY of a grid of HZ; 0: none
 *   tolerance INSTANCE STATE BITS                     absolute, of a continuous state by its number
 *   call INSTANCE output|stage|update                 in order of evaluation; stage: an output that derivatives need
 *   set INSTANCE FIELD ELEMENT BITS                   before init
 *   link INSTANCE FIELD INSTANCE FIELD                from, to
 *   sensor INSTANCE FIELD CHANNEL                     from, to
 *   actuator CHANNEL INSTANCE FIELD                   from, to
 *   companion_sensor INSTANCE FIELD COMPANION CHANNEL
 *   companion_actuator COMPANION CHANNEL INSTANCE FIELD
 *   read MACHINE_FIELD INSTANCE FIELD                 from, to: any field of the machine
 *   write INSTANCE FIELD MACHINE_FIELD                from, to
 *   event TIME_NS INSTANCE FIELD ELEMENT BITS
 *   serial_link INSTANCE                              between plant and controller (serial_link.h)
 *   until TICKS EXPRESSION                            it has held so many; to the end of the line (fcsl_expression.h)
 *   views TEXT                                        to the end of the line: they replace the machine's (fcsl_run_set_views)
 *   end
 *
 * BITS are 16 hexadecimal digits: the scalar's bits, zero-extended. The plan starts with the first line and ends with `end`, so
 * a truncated plan is detected. `machine`, `seed` and `ticks` occur exactly once.
 */
#ifndef FCSL_SIM_PLAN_H
#define FCSL_SIM_PLAN_H

#include "fcsl/fcsl_run.h"
#include "integrators/integrate.h"

#define FCSL_PLAN_MAX_BYTES       (4u << 20)
#define FCSL_PLAN_MAX_LINE        (FCSL_VIEWS_BYTES_MAX + 8u)
#define FCSL_PLAN_MAX_MODELS      64u
#define FCSL_PLAN_MAX_INSTANCES   256u
#define FCSL_PLAN_MAX_GROUPS      256u
#define FCSL_PLAN_MAX_CALLS       1024u
#define FCSL_PLAN_MAX_COMPANIONS  64u
#define FCSL_PLAN_MAX_LINKS       4096u /* of each kind */
#define FCSL_PLAN_MAX_SETS        65536u /* of each kind */
#define FCSL_PLAN_MAX_HZ          1000000u
#define FCSL_PLAN_MAX_GRID_HZ     1000000000u
#define FCSL_PLAN_MAX_SECONDS     1000000000u
#define FCSL_PLAN_MAX_DELAY_TICKS 1000u
#define FCSL_PLAN_MAX_TICKS       UINT64_C(1000000000000)

/* Every record has its line number, for messages. All strings point into the plan's copy of the text. */
typedef struct {
    uint32_t line;
    const char *name;
    const char *library;
    int is_machine; /* of a model: it is a machine */
} fcsl_plan_library_t;

typedef struct {
    uint32_t line;
    const char *name;
    const char *model;
    uint32_t group; /* FCSL_PLAN_NO_GROUP: none */
    uint64_t hz;    /* of the grid of its updates; 0: none */
    uint64_t every;
    uint64_t phase;
} fcsl_plan_instance_t;

#define FCSL_PLAN_NO_GROUP UINT32_MAX

typedef struct {
    uint32_t line;
    fcsl_method_t method;
    uint64_t hz; /* of fixed steps; 0: adaptive */
    double rtol;
    double atol;
    double min_step_s;
    double max_step_s;
} fcsl_plan_group_t;

typedef struct {
    uint32_t line;
    const char *instance;
    uint64_t state;
    double atol;
} fcsl_plan_tolerance_t;

typedef enum { FCSL_CALL_OUTPUT, FCSL_CALL_STAGE, FCSL_CALL_UPDATE } fcsl_call_kind_t;

typedef struct {
    uint32_t line;
    const char *instance;
    fcsl_call_kind_t kind;
} fcsl_plan_call_t;

typedef struct {
    uint32_t line;
    const char *name;
    const char *machine;
    const char *library;
    uint32_t delay_ticks;
} fcsl_plan_companion_t;

typedef struct {
    uint32_t line;
    const char *instance;
    const char *field;
    uint64_t element;
    uint64_t bits;
    uint64_t time_ns; /* events only */
} fcsl_plan_set_t;

typedef struct {
    uint32_t line;
    const char *companion;     /* null: the first controller */
    const char *from_instance; /* null: a channel, or a field of a machine */
    const char *from_field;
    const char *to_instance; /* null: a channel, or a field of a machine */
    const char *to_field;
} fcsl_plan_link_t;

/* A sensor channel that gets no sample before. */
typedef struct {
    uint32_t line;
    const char *companion; /* null: of the first controller */
    const char *channel;
    uint64_t time_ns;
} fcsl_plan_first_sample_t;

typedef struct {
    char *text;
    fcsl_plan_library_t machine;
    uint32_t seed_line;
    uint64_t seed;
    uint32_t ticks_line;
    uint64_t ticks;
    uint32_t delay_ticks;
    fcsl_plan_companion_t *companions;
    uint32_t companion_count;
    fcsl_plan_library_t *models;
    uint32_t model_count;
    fcsl_plan_group_t *groups;
    uint32_t group_count;
    fcsl_plan_instance_t *instances;
    uint32_t instance_count;
    fcsl_plan_tolerance_t *tolerances;
    uint32_t tolerance_count;
    fcsl_plan_call_t *calls;
    uint32_t call_count;
    fcsl_plan_set_t *sets;
    uint32_t set_count;
    fcsl_plan_link_t *links;
    uint32_t link_count;
    fcsl_plan_link_t *sensors;
    uint32_t sensor_count;
    fcsl_plan_first_sample_t *first_samples;
    uint32_t first_sample_count;
    fcsl_plan_link_t *actuators;
    uint32_t actuator_count;
    fcsl_plan_link_t *reads;
    uint32_t read_count;
    fcsl_plan_link_t *writes;
    uint32_t write_count;
    fcsl_plan_set_t *events;
    uint32_t event_count;
    fcsl_plan_library_t serial_link; /* its instance; name null: none */
    uint32_t until_line;
    const char *until; /* null: none */
    uint64_t until_ticks;
    const char *views; /* null: those of the machine */
} fcsl_plan_t;

/* Returns 0, or -1 with a message that names the line. Call fcsl_plan_free in both cases. */
int fcsl_plan_parse(fcsl_plan_t *plan, const char *text, size_t size, fcsl_error_t *error);
void fcsl_plan_free(fcsl_plan_t *plan);

#endif /* FCSL_SIM_PLAN_H */
