/* SPDX-License-Identifier: Apache-2.0
 *
 * Model plugins: loading, checking, finding fields.
 */
#ifndef FCSL_SIM_MODEL_H
#define FCSL_SIM_MODEL_H

#include "fcsl/fcsl_model.h"
#include "fcsl/fcsl_run.h"

#define FCSL_MODEL_MAX_FIELDS     1024u
#define FCSL_MODEL_MAX_BYTES      (1u << 20)
#define FCSL_MODEL_MAX_CONTINUOUS 4096u
#define FCSL_MODEL_MAX_EVENTS     64u
#define FCSL_MODEL_MAX_PATH       200u

/* Loads `library` and finds its model `name`; rejects another ABI version and invalid tables.
 * *handle receives the argument of fcsl_model_unload. Returns null on failure. */
const fcsl_model_t *fcsl_model_load(const char *library, const char *name, void **handle, fcsl_error_t *error);
void fcsl_model_unload(void *handle);

/* Rejects a descriptor that breaks a rule of fcsl_model.h; `library` is for the message. Returns 0, or -1. */
int fcsl_model_check(const fcsl_model_t *model, const char *library, fcsl_error_t *error);
/* The field of this path, or null. */
const fcsl_field_t *fcsl_model_field(const fcsl_model_t *model, const char *path);

#endif /* FCSL_SIM_MODEL_H */
