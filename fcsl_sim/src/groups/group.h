/* SPDX-License-Identifier: Apache-2.0
 *
 * A group: the models that outputs connect directly. Their continuous states are one vector, integrated together; their events
 * are located within the steps. Inputs from outside of the group hold during a step.
 */
#ifndef FCSL_SIM_GROUP_H
#define FCSL_SIM_GROUP_H

#include "fcsl/fcsl_model.h"
#include "integrators/integrate.h"
#include "plan/plan.h"
#include "plant/plant.h"

typedef struct fcsl_group fcsl_group_t;

/* A group that comes to a stop: this many events in a row, each within FCSL_CHATTER_NS of the one before. */
#define FCSL_CHATTER_EVENTS 100u
#define FCSL_CHATTER_NS     1000

/* What one step leaves for the next one, but for vectors. */
typedef struct {
    int64_t time_ns;  /* present */
    uint64_t step;    /* of the grid of fixed steps: the last one at or before the present */
    int64_t begin_ns; /* its time */
    int64_t end_ns;   /* that of the next one */
    uint64_t carry;   /* what end_ns is rounded down by, in 1/hz ns */
    int64_t from_ns;  /* RK45: the step under way, of which states are interpolated */
    int64_t to_ns;
    int64_t event_ns; /* RK45: of the first event in that step; 0: none */
    double next_s;    /* RK45: the step to try; 0: not known */
    double since_s;   /* the last announced jump (announced_jumps.c) that is at the present or before it */
    int64_t last_event_ns;
    uint32_t events_in_a_row;
    uint8_t has_slope; /* of the integrator */
    uint8_t kept;
    uint8_t disturbed; /* something besides the inputs has changed */
} fcsl_group_state_t;

struct fcsl_group {
    fcsl_plant_t *plant;
    const fcsl_plan_group_t *plan;
    fcsl_integrator_t integrator;
    fcsl_group_state_t state;
    uint32_t n;           /* continuous states */
    uint32_t event_count;
    uint8_t *crossing;    /* by event: fcsl_crossing_t */
    uint8_t *fired;       /* by event: among those of now */
    uint32_t *derived;    /* instances with continuous states */
    void (*derivative)(const void *self, double t, const double *x, double *dx); /* of a single one, else null */
    const void *derivative_of; /* its struct */
    uint32_t *blocks;     /* how many each of them has */
    uint32_t derived_count;
    uint32_t *eventful;   /* instances with events */
    uint32_t eventful_count;
    uint32_t *stages;     /* instances whose outputs derivatives or events need, in order of evaluation */
    uint32_t stage_count;
    uint32_t *outputs;    /* instances with outputs, in order of evaluation; one may be there twice */
    uint32_t output_count;
    uint32_t *timed;      /* instances that are updated at a rate, in the group or with outputs to it */
    uint32_t timed_count;
    uint32_t *sampling;   /* instances outside of the group whose update reads one of its outputs */
    uint32_t sampling_count;
    uint8_t *companions;  /* by companion: whether it meets the group */
    uint32_t next_write;  /* in event_order: no write to the group is before it */
    uint32_t *announcing; /* instances with next_time */
    uint32_t announcing_count;
    double jump_s;        /* the next announced jump; infinite: none */
    int64_t jump_ns;      /* its nanosecond */
    double last_s;        /* the largest time before it */
    uint32_t *outer;      /* copies from outside of the group */
    uint32_t outer_count;
    double *memory;       /* all vectors below, and the integrator's */
    double *x;            /* n: at the present, or at the beginning of the step under way (RK45) */
    double *x1;           /* n: at the end of the step */
    double *probe;        /* n */
    double *atol;         /* n */
    double *g;            /* event_count: at the present */
    double *g1;           /* event_count */
    double *g_probe;      /* event_count */
};

/* Once the lists and the plan of a group are there: allocates its vectors. Returns 0, or -1. */
int fcsl_group_open(fcsl_group_t *group, fcsl_plant_t *plant, fcsl_error_t *error);
/* After init of the models: refuses models that the method cannot integrate. */
int fcsl_group_check(fcsl_group_t *group, fcsl_error_t *error);
void fcsl_group_free(fcsl_group_t *group);

/* After init, with the inputs of the beginning: from these values on events are watched. */
int fcsl_group_start(fcsl_group_t *group, fcsl_error_t *error);
/* Brings all states of the group to `time_ns`, and handles its events until then. No step goes beyond `barrier_ns`, when inputs may
 * jump; time_ns <= barrier_ns. Returns 0, or -1. */
int fcsl_group_advance(fcsl_group_t *group, int64_t time_ns, int64_t barrier_ns, fcsl_error_t *error);

/* What a checkpoint needs: the state, and vectors of so many doubles. */
size_t fcsl_group_saved(const fcsl_group_t *group);
void fcsl_group_save(const fcsl_group_t *group, fcsl_group_state_t *state, double *vectors);
void fcsl_group_restore(fcsl_group_t *group, const fcsl_group_state_t *state, const double *vectors);

/* ---- between the files of a group ---------------------------------------------------------------------------------- */

/* The outputs that events need, then the event functions, at t (s) for states x. Fails where one is NaN. */
int fcsl_group_events(fcsl_group_t *group, double t, const double *x, double *value, fcsl_error_t *error);
int fcsl_group_check_events(const fcsl_group_t *group, double t, const double *value, fcsl_error_t *error);
/* group->g becomes `now`, in which no event has happened: a zero stays at the side from which it came. */
void fcsl_group_pass(fcsl_group_t *group, const double *now);
/* Whether event number `event` of the group happens where its function goes from `before` to `after`. Zero belongs to the side
 * from which the function came, and counts as crossed only once it has been left. */
static inline int fcsl_group_crosses(const fcsl_group_t *group, uint32_t event, double before, double after)
{
    const uint8_t crossing = group->crossing[event];
    return ((crossing & FCSL_FALLING) != 0 && before >= 0.0 && after < 0.0) ||
           ((crossing & FCSL_RISING) != 0 && before <= 0.0 && after > 0.0);
}
int fcsl_group_any_crosses(const fcsl_group_t *group, const double *before, const double *after);
/* The states at the present, into the models; and from them. */
void fcsl_group_scatter(const fcsl_group_t *group, const double *x);
int fcsl_group_gather(const fcsl_group_t *group, double *x); /* whether one is another than in x */
/* Handles all events at the present, whose functions came from group->g to `now`; then group->g is that of now. Returns 0, or -1. */
int fcsl_group_fire(fcsl_group_t *group, double *now, fcsl_error_t *error);
/* What the integrator has carried over is void: a state or an input has jumped. */
void fcsl_group_restart(fcsl_group_t *group);
/* Fails where one of the states x, at time_ns, is not finite. */
int fcsl_group_check_finite(const fcsl_group_t *group, const double *x, int64_t time_ns, fcsl_error_t *error);
/* The present in s. */
double fcsl_group_time_s(const fcsl_group_t *group);
/* Names continuous state number `state`: "lander.state.pos_z". */
void fcsl_group_name_state(const fcsl_group_t *group, uint32_t state, char *text, size_t size);

/* group_events.c: states at `offset_ns` within a step, for a search. */
typedef void (*fcsl_probe_t)(fcsl_group_t *group, int64_t offset_ns, double *x);
/* The first offset in (0, length_ns] at which an event has happened; group->g1 is at the end of the step, where one has. */
int64_t fcsl_group_locate(fcsl_group_t *group, int64_t from_ns, int64_t length_ns, fcsl_probe_t probe);

/* announced_jumps.c: the next announced jump, behind the present. Returns 0, or -1. */
int fcsl_group_find_jump(fcsl_group_t *group, fcsl_error_t *error);
/* Once the present is the nanosecond of that jump: goes to its other side. Returns 0, or -1. */
int fcsl_group_jump(fcsl_group_t *group, fcsl_error_t *error);
/* A time of a step, which does not reach the jump at its end. */
static inline double fcsl_group_before_jump(const fcsl_group_t *group, double t)
{
    return t < group->last_s ? t : group->last_s;
}
/* Goes on from states or inputs that have jumped. Events that this has caused happen now. Returns 0, or -1. */
int fcsl_group_resume(fcsl_group_t *group, fcsl_error_t *error);

/* group_adaptive.c */
int fcsl_group_advance_adaptive(fcsl_group_t *group, int64_t time_ns, int64_t barrier_ns, fcsl_error_t *error);

#endif /* FCSL_SIM_GROUP_H */
