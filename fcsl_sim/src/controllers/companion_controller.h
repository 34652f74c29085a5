/* SPDX-License-Identifier: Apache-2.0
 *
 * Companions: further controllers that are hosted beside the first one, each at its own rate. They meet the plant in messages of
 * channels, as the first one does.
 */
#ifndef FCSL_SIM_COMPANION_CONTROLLER_H
#define FCSL_SIM_COMPANION_CONTROLLER_H

#include "fcsl/fcsl_gate.h"
#include "fcsl/fcsl_run.h"
#include "delay.h"
#include "plan/plan.h"
#include "plant/plant.h"

/* One output copied to a sensor channel. */
typedef struct {
    const uint8_t *from;
    uint8_t *to; /* in the channel image */
    uint32_t size;
    uint32_t instance; /* instance of the output */
    uint32_t channel;
    uint64_t samples; /* of the instance, when the channel got the last one */
    int64_t first_ns; /* those taken before are lost */
} fcsl_sensor_t;

typedef struct {
    const char *name;
    fcsl_run_t *run;
    const fcsl_machine_t *machine;
    uint8_t *image;  /* a struct of the machine: only its channel fields are defined */
    uint8_t *select; /* per channel: included in the next sensor message */
    uint8_t *bytes;  /* of a message */
    size_t capacity;
    fcsl_gate_t gate;
    fcsl_delay_t delay;
    fcsl_sensor_t *sensors;
    uint32_t sensor_count;
    uint64_t tick;        /* completed ones */
    int64_t next_tick_ns;
    int due;
} fcsl_companion_t;

/* Loads the machine of a companion. Returns 0, or -1. */
int fcsl_companion_open(fcsl_companion_t *companion, const fcsl_plan_companion_t *plan,
                        const fcsl_parameters_t *parameters, fcsl_error_t *error);
/* Once it has its sensors: attaches its channels. */
int fcsl_companion_start(fcsl_companion_t *companion, fcsl_error_t *error);
int fcsl_companion_close(fcsl_companion_t *companion, fcsl_error_t *error);
/* One tick at the present: sensors, step, actuators. Returns 0, or -1. */
int fcsl_companion_tick(fcsl_companion_t *companion, fcsl_plant_t *plant, fcsl_error_t *error);

/* Copies the sensors whose instance has a sample since their last one into the image, and selects their channels. Clears those of
 * other channels. Also those of the first controller. */
void fcsl_sensors_sample(const fcsl_plant_t *plant, fcsl_sensor_t *sensors, uint32_t count, uint8_t *select,
                         uint32_t channels);

#endif /* FCSL_SIM_COMPANION_CONTROLLER_H */
