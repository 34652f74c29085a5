/* SPDX-License-Identifier: Apache-2.0
 *
 * A machine with one instance as a model: its algorithm, compiled from Python, is a plant's part or a sensor. An update is one tick
 * of the machine.
 */
#ifndef FCSL_SIM_MACHINE_MODEL_H
#define FCSL_SIM_MACHINE_MODEL_H

#include "fcsl/fcsl_model.h"
#include "fcsl/fcsl_run.h"

typedef struct fcsl_machine_model fcsl_machine_model_t;

/* Null on failure. The model has the name of the machine. */
fcsl_machine_model_t *fcsl_machine_model_open(const char *library, const char *machine, fcsl_error_t *error);
void fcsl_machine_model_close(fcsl_machine_model_t *model);
const fcsl_model_t *fcsl_machine_model_of(const fcsl_machine_model_t *model);
/* Binds the parameters of the machine JSON in the struct of an instance. */
void fcsl_machine_model_init(const fcsl_machine_model_t *model, void *self);
/* Runs `start`, once the instance has its parameters. Returns 0, or -1: it faults. */
int fcsl_machine_model_start(const fcsl_machine_model_t *model, void *self, fcsl_error_t *error);

/* Whether a struct from a checkpoint is one of the machine's: no state, no enumeration has an impossible value. */
int fcsl_machine_model_takes(const fcsl_machine_model_t *model, const void *self);

#endif /* FCSL_SIM_MACHINE_MODEL_H */
