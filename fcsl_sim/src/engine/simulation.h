/* SPDX-License-Identifier: Apache-2.0
 *
 * The struct of a simulation. Everything is allocated by open; a running simulation allocates nothing.
 */
#ifndef FCSL_SIM_SIMULATION_H
#define FCSL_SIM_SIMULATION_H

#include "fcsl/fcsl_expression.h"
#include "fcsl/fcsl_external.h"
#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_sim.h"
#include "controllers/companion_controller.h"
#include "controllers/serial_link.h"
#include "event_queue.h"
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

/* The message of what an instance puts out (model_messages.c). */
typedef struct {
    char *type;
    char *schema;
    uint32_t size; /* bytes of the message */
    int topic;     /* in the bag */
} fcsl_model_message_t;

/* What the actuators get (actuators.c). */
typedef struct {
    fcsl_instance_state_t as_instance; /* for what describes, records and serves an instance of a model */
    fcsl_model_message_t message;
    fcsl_model_t model;
    fcsl_field_t *fields; /* of the gate, then one for each actuator channel in table order */
    char *texts;          /* the model's name, and the paths of the channels */
} fcsl_actuators_t;

/* When ticks may run (tick_pacing.c). */
typedef struct {
    double speed; /* limit on simulated seconds per second; 0: as fast as possible */
    int paused;   /* a client of the variable server keeps it paused */
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
    fcsl_expression_t *until; /* the stop condition; null: none */
    uint64_t until_held; /* ticks in a row that the stop condition has held */
    uint64_t tick;
    double *group_scratch; /* the vectors of one group, for checkpoints */
    uint8_t *before;       /* the plant before a checkpoint was restored */
    int sensed; /* between sense and actuate */
    int failed; /* a tick has failed on its way: without a checkpoint there is no next one */
    fcsl_sim_status_t status;
    int recording;
    fcsl_model_message_t *model_messages; /* by instance */
    uint8_t *model_message_bytes; /* scratch for one message */
    fcsl_external_t *external; /* null: the machine is hosted here */
    uint32_t external_timeout_ms;
    int awaits_answer; /* the sensors of the tick were sent to it */
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

#endif /* FCSL_SIM_SIMULATION_H */
