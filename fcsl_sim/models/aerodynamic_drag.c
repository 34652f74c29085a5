/* SPDX-License-Identifier: Apache-2.0
 *
 * The drag of a body that has one drag coefficient from all sides: a sphere, a parachute.
 *
 * F = -(density / 2) area drag_coefficient |v| v,  with v the velocity through the air
 *
 * It acts at the centre of mass. The coefficient depends neither on Mach nor on Reynolds number.
 */
#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    struct {
        double velocity_air_body[3];
        double density;
    } inputs;
    struct {
        double area, drag_coefficient;
    } parameters;
    struct {
        double force_body[3];
    } outputs;
} aerodynamic_drag_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const aerodynamic_drag_t *drag = self;
    (void)context;
    if (!(drag->parameters.area >= 0.0)) {
        return "parameters.area must not be negative";
    }
    if (!(drag->parameters.drag_coefficient >= 0.0)) {
        return "parameters.drag_coefficient must not be negative";
    }
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    aerodynamic_drag_t *drag = self;
    (void)t, (void)x;
    const double *velocity = drag->inputs.velocity_air_body;
    const double factor =
        0.5 * drag->inputs.density * drag->parameters.area * drag->parameters.drag_coefficient * vector_norm(velocity);
    for (int i = 0; i < 3; i++) {
        drag->outputs.force_body[i] = -factor * velocity[i];
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(aerodynamic_drag_t, FCSL_ROLE_INPUT, inputs.velocity_air_body, "m/s",
                      "of the body through the air"),
    FCSL_MODEL_SCALAR(aerodynamic_drag_t, FCSL_ROLE_INPUT, inputs.density, "kg/m^3", ""),
    FCSL_MODEL_SCALAR(aerodynamic_drag_t, FCSL_ROLE_PARAMETER, parameters.area, "m^2", "reference area"),
    FCSL_MODEL_SCALAR(aerodynamic_drag_t, FCSL_ROLE_PARAMETER, parameters.drag_coefficient, "", "with that area"),
    FCSL_MODEL_VECTOR(aerodynamic_drag_t, FCSL_ROLE_FEEDTHROUGH, outputs.force_body, "N", "at the centre of mass"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "aerodynamic_drag",
    .doc = "the drag of a sphere or a parachute",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(aerodynamic_drag_t),
    .align = _Alignof(aerodynamic_drag_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
