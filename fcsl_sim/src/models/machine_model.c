/* SPDX-License-Identifier: Apache-2.0
 *
 * The table of a model from that of a machine.
 */
#include "machine_model.h"

#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_hw.h"
#include "fcsl/fcsl_error.h"
#include "model.h"

struct fcsl_machine_model {
    fcsl_model_t model; /* first: a context leads back here */
    fcsl_run_t *run;    /* has the library */
    const fcsl_machine_t *machine;
    fcsl_field_t *fields;
};

/* One tick, without hardware. A fault leaves the outputs as they were, as in a controller. */
static void update(void *self, const fcsl_model_context_t *context)
{
    static const struct fcsl_hw none = {0};
    const fcsl_host_t host = {.hw = &none};
    const fcsl_machine_model_t *model = (const fcsl_machine_model_t *)(const void *)context->model;
    model->machine->step(self, &host);
}

/* A field of the instance that models have, without the name of the instance. */
static int take_field(const fcsl_field_t *from, const char *instance, fcsl_field_t *field)
{
    const size_t length = strlen(instance);
    if (strncmp(from->path, instance, length) != 0 || from->path[length] != '.' || from->role < FCSL_ROLE_INPUT ||
        from->role > FCSL_ROLE_STATE || from->type > FCSL_F64 ||
        from->connected_from != FCSL_NONE) { /* machine.dt and the like */
        return 0;
    }
    *field = *from;
    field->path += length + 1u;
    field->flags = 0;
    field->instance = FCSL_NONE;
    field->connected_from = FCSL_NONE;
    return 1;
}

fcsl_machine_model_t *fcsl_machine_model_open(const char *library, const char *machine, fcsl_error_t *error)
{
    fcsl_machine_model_t *model = calloc(1, sizeof *model);
    if (!model) {
        (void)fcsl_fail(error, "no memory for the model `%s`", machine);
        return NULL;
    }
    model->run = fcsl_run_open(library, machine, NULL, error);
    model->machine = model->run ? fcsl_run_machine(model->run) : NULL;
    model->fields = model->run ? calloc(model->machine->field_count + 1u, sizeof *model->fields) : NULL;
    if (!model->fields || model->machine->instance_count != 1u) {
        if (model->fields) {
            (void)fcsl_fail(error, "machine `%s` has %u instances; as a model it has one", machine,
                            model->machine->instance_count);
        } else if (model->run) {
            (void)fcsl_fail(error, "no memory for the model `%s`", machine);
        }
        fcsl_machine_model_close(model);
        return NULL;
    }
    uint32_t count = 0;
    for (uint32_t i = 0; i < model->machine->field_count; i++) {
        count +=
            (uint32_t)take_field(&model->machine->fields[i], model->machine->instances[0].name, &model->fields[count]);
    }
    model->model = (fcsl_model_t){.abi_version = FCSL_MODEL_ABI_VERSION,
                                  .name = model->machine->name,
                                  .doc = "",
                                  .fields = model->fields,
                                  .field_count = count,
                                  .size = model->machine->size,
                                  .align = model->machine->align,
                                  .sampled_offset = FCSL_NO_OFFSET,
                                  .update = update};
    if (fcsl_model_check(&model->model, library, error)) {
        fcsl_machine_model_close(model);
        return NULL;
    }
    return model;
}

void fcsl_machine_model_close(fcsl_machine_model_t *model)
{
    if (model) {
        (void)fcsl_run_close(model->run, NULL); /* it records nothing */
        free(model->fields);
        free(model);
    }
}

const fcsl_model_t *fcsl_machine_model_of(const fcsl_machine_model_t *model)
{
    return &model->model;
}

void fcsl_machine_model_init(const fcsl_machine_model_t *model, void *self)
{
    model->machine->init(self);
}

int fcsl_machine_model_start(const fcsl_machine_model_t *model, void *self, fcsl_error_t *error)
{
    return model->machine->start(self) == 0 ? 0 : fcsl_fail(error, "`start` of `%s` faults", model->machine->name);
}

int fcsl_machine_model_takes(const fcsl_machine_model_t *model, const void *self)
{
    fcsl_error_t error; /* the run's own struct is not used otherwise */
    return fcsl_run_restore(model->run, self, model->machine->size, &error) == 0;
}
