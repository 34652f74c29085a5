/* SPDX-License-Identifier: Apache-2.0
 *
 * Shared declarations of the simulator's files. Everything is allocated by open; a running simulation allocates nothing.
 */
#ifndef FCSL_SIM_INTERNAL_H
#define FCSL_SIM_INTERNAL_H

#include "controllers/companion_controller.h"
#include "controllers/serial_link.h"
#include "event_queue.h"
#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_sim.h"
#include "groups/group.h"
#include "plan/plan.h"
#include "plant/plant.h"

/* A field of the hosted machine beside its channels, connected with a model. */
typedef struct {
    uint32_t field;   /* of the machine */
    uint8_t *data;    /* of the model */
    uint32_t size;
} fcsl_field_link_t;

/* One scalar write. */
typedef struct {
    uint8_t *to;
    uint32_t size;
    uint64_t bits;
    uint32_t instance;
    uint32_t group; /* of the instance */
} fcsl_write_t;

/* What the actuators get (actuators.c). */
typedef struct {
    fcsl_instance_state_t as_instance; /* for what describes, records and serves an instance of a model */
    fcsl_model_t model;
    fcsl_field_t *fields; /* of the gate, then one for each actuator channel in table order */
    char *texts;          /* the model's name, and the paths of the channels */
} fcsl_actuators_t;

/* When ticks may run (pacing.c). */
typedef struct {
    double speed; /* limit on simulated seconds per second; 0: as fast as possible */
    int anchored; /* tick from_tick was due at from_ns of the monotonic clock */
    uint64_t from_ns;
    uint64_t from_tick;
} fcsl_pace_t;

struct fcsl_sim_service;
struct fcsl_sim_published;
struct fcsl_sim_topics;

struct fcsl_sim {
    fcsl_plant_t plant;
    fcsl_plan_t plan;
    fcsl_run_t *run;
    const fcsl_machine_t *machine;
    void **handles; /* of the model libraries */
    fcsl_machine_model_t **machine_models; /* by model; null: a plugin */
    const fcsl_model_t **models;
    fcsl_sensor_t *sensors;
    uint32_t sensor_count;
    fcsl_delay_t delay;
    fcsl_companion_t *companions;
    uint32_t companion_count;
    int reads_fields; /* an input of a model is connected with a field of the hosted machine */
    fcsl_field_link_t *writes; /* outputs of models to fields of the hosted machine */
    uint32_t write_count;
    fcsl_write_t *events;
    uint32_t *event_order; /* by time, then as in the plan */
    uint32_t next_event;   /* in event_order */
    fcsl_group_t *groups;
    uint32_t group_count;
    uint8_t *image;  /* the plant's copy of the machine's struct: only its channel fields are defined */
    uint8_t *select; /* per channel: included in the next sensor message */
    uint8_t *message_bytes;
    size_t message_capacity;
    fcsl_gate_t gate;            /* before the actuators */
    fcsl_actuators_t *actuators; /* null: the machine neither arms nor has a time-out */
    fcsl_sim_link_t *link; /* between plant and controller; null: none */
    uint32_t link_instance;
    fcsl_event_queue_t queue;
    const uint8_t *until_field;
    uint8_t until_type;
    uint64_t until_held; /* ticks in a row that the stop condition has held */
    uint64_t tick;
    double *group_scratch; /* the vectors of one group, for checkpoints */
    uint8_t *before;       /* the plant before a checkpoint was restored */
    int sensed; /* between sense and actuate */
    int failed; /* a tick has failed on its way: without a checkpoint there is no next one */
    fcsl_sim_status_t status;
    int recording;
    uint8_t *truth; /* scratch for one truth message */
    fcsl_external_t *external; /* null: the machine is hosted here */
    uint32_t external_timeout_ms;
    int asked; /* the sensors of the tick were sent to it */
    struct fcsl_sim_topics *topics; /* null: none */
    struct fcsl_sim_published *published; /* null: no variable server, telemetry, observers */
    struct fcsl_sim_service *service;     /* null: no variable server */
    fcsl_telemetry_t *telemetry;          /* null: none */
    fcsl_observers_t *observers;          /* null: none */
    fcsl_ros_graph_t *ros;                /* null: none */
    fcsl_pace_t pace;
    int service_failed;                   /* a tick that a client asked for failed with `failure` */
    fcsl_error_t failure;
};

/* crash_handler.c: the simulation exists, or no longer. */
void fcsl_sim_is_open(const fcsl_plant_t *plant, int is_open);
/* sim.c: the next events of a simulation between two ticks, from its instances. */
void fcsl_sim_refill_queue(fcsl_sim_t *sim);
/* sim.c: something besides the plant itself has changed a value of an instance. */
void fcsl_sim_disturb(fcsl_sim_t *sim, uint32_t instance);

/* sim.c: fcsl_sim_sense and fcsl_sim_actuate without validation of messages. Each returns 0, or -1. */
int fcsl_sim_sense_message(fcsl_sim_t *sim, uint8_t *bytes, size_t capacity, fcsl_message_t *message,
                           fcsl_error_t *error);
int fcsl_sim_actuate_message(fcsl_sim_t *sim, const fcsl_message_t *message, fcsl_error_t *error);
/* Completes a sensed tick without an actuator message: the actuators hold what they have, until the gate's time-out. */
void fcsl_sim_hold(fcsl_sim_t *sim);
/* host.c: one tick, with the hosted or the connected controller. */
int fcsl_sim_tick_once(fcsl_sim_t *sim, fcsl_error_t *error);

/* host.c: says what became of a message to or from the external controller; returns -1. */
int fcsl_sim_external_failed(const fcsl_sim_t *sim, fcsl_hal_status_t status, const char *doing, fcsl_error_t *error);

/* ros_topics.c: what the sensed tick shows, into the outbox. */
void fcsl_sim_topics_put(fcsl_sim_t *sim);
/* Who takes from the outbox looks at once. */
void fcsl_sim_topics_wake(const fcsl_sim_t *sim);
void fcsl_sim_topics_free(fcsl_sim_t *sim);

/* publish.c: publishes the current values to clients, telemetry and observers. */
void fcsl_sim_publish(fcsl_sim_t *sim);
void fcsl_sim_publish_end(fcsl_sim_t *sim);
/* variable_server.c: executes a waiting command; waits a while and returns 0 if no tick may run now. */
int fcsl_sim_attend(fcsl_sim_t *sim);
/* variable_server.c: updates the tick counters of `stats`; does nothing without a variable server. */
uint64_t fcsl_sim_tick_begins(const fcsl_sim_t *sim);
void fcsl_sim_tick_ends(fcsl_sim_t *sim, uint64_t begun_ns);
void fcsl_sim_end_service(fcsl_sim_t *sim);
/* variable_server.c: whether a client keeps the simulation paused. */
int fcsl_sim_paused(const fcsl_sim_t *sim);
/* pacing.c: the time of the monotonic clock to wait for, at most a short while ahead even if the next tick is due later. 0 if
 * it is due. */
uint64_t fcsl_sim_wait_until(fcsl_sim_t *sim);
/* pacing.c: sleeps until then, or until a signal. */
void fcsl_sim_sleep_until(uint64_t deadline_ns);
/* pacing.c: a simulation that is late by more than 0.1 s does not make up for it. */
void fcsl_sim_forgive(fcsl_sim_t *sim);
/* pacing.c: the next tick is due at once, later ones relative to it. */
void fcsl_sim_pace_anew(fcsl_sim_t *sim);

/* sim.c: a command arrives at the plant. */
void fcsl_sim_take_command(void *sim, const fcsl_message_t *command);

/* assembly.c: the number of an instance; 0, or -1. */
int fcsl_sim_find_instance(const fcsl_sim_t *sim, uint32_t line, const char *name, uint32_t *index,
                           fcsl_error_t *error);
/* assembly.c: a field of an instance, or null. */
const fcsl_field_t *fcsl_sim_find_field(const fcsl_sim_t *sim, uint32_t line, const char *name, const char *path,
                                        uint32_t *index, fcsl_error_t *error);
/* assembly.c: says what is wrong with a name in a line of the plan; returns -1. */
int fcsl_sim_fail_line(fcsl_error_t *error, uint32_t line, const char *what, const char *name);
/* connections.c */
int fcsl_sim_build_connections(fcsl_sim_t *sim, fcsl_error_t *error);
/* group_build.c: the order of calls, and the groups of models that integrate together. */
int fcsl_sim_build_groups(fcsl_sim_t *sim, fcsl_error_t *error);
/* assembly.c: builds everything that the plan names. The plan must be parsed, the rest zero. */
int fcsl_assembly_build(fcsl_sim_t *sim, fcsl_error_t *error);
void fcsl_assembly_free(fcsl_sim_t *sim);

/* truth_messages.c: type, schema and size of every instance's message, and of the actuators'. */
int fcsl_truth_build(fcsl_sim_t *sim, fcsl_error_t *error);
void fcsl_truth_free(fcsl_sim_t *sim);
/* truth_messages.c: the outputs as CDR, stamped with the present time. Returns its bytes, or 0 when it does not fit. */
size_t fcsl_truth_write(const fcsl_sim_t *sim, const fcsl_instance_state_t *instance, uint8_t *cdr_bytes,
                        size_t capacity);

#endif /* FCSL_SIM_INTERNAL_H */
