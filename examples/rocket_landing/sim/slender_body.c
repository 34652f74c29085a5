/* SPDX-License-Identifier: Apache-2.0
 *
 * Aerodynamic force and torque of a body of revolution about its z axis, from tables over the angle between its axis and
 * its motion through the air.
 *
 *   (u, v, w): velocity through the air,  V = |(u, v, w)|,  angle = atan2(hypot(u, v), w)
 *   force  = -density / 2 V^2 area (normal(angle) (u, v) / hypot(u, v), axial(angle))
 *   torque = (0, 0, centre_of_pressure - c) x force
 *
 * The angle is 0 when the body moves along +z, tail first, and pi when it moves nose first; `axial` is positive at 0 and
 * negative at pi. c is the z of `centre_of_mass_body`, from the same origin as the centre of pressure.
 *
 * Source: the definition of the coefficients. Those of this vehicle: aerodynamics.py.
 *
 * Limits: one centre of pressure for all angles, no damping, no Mach number, no jet.
 */
#include <math.h>

#include "fcsl/fcsl_math.h"
#include "fcsl/fcsl_model.h"

enum { CAPACITY = 40 };

typedef struct {
    struct {
        double velocity_air_body[3];
        double density;
        double centre_of_mass_body[3];
    } inputs;
    struct {
        double angle[CAPACITY];
        double axial[CAPACITY];
        double normal[CAPACITY];
        double area;
        double centre_of_pressure;
    } parameters;
    struct {
        double force_body[3];
        double torque_body[3];
        double angle;
    } outputs;
} slender_body_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const slender_body_t *body = self;
    (void)context;
    const double *angle = body->parameters.angle;
    for (int i = 1; i < CAPACITY; i++) {
        const int fills = angle[i] == angle[i - 1] && angle[i] == angle[CAPACITY - 1];
        if (!(angle[i] > angle[i - 1] || fills)) {
            return "parameters.angle must increase from row to row";
        }
    }
    return body->parameters.area >= 0.0 ? NULL : "parameters.area must not be negative";
}

/* Linear between rows; beyond the table its ends hold. */
static double interpolated(const double *angle, const double *column, double at)
{
    for (int i = 1; i < CAPACITY && angle[i] > angle[i - 1]; i++) {
        if (at < angle[i]) {
            const double fraction = fmax(0.0, (at - angle[i - 1]) / (angle[i] - angle[i - 1]));
            return column[i - 1] + fraction * (column[i] - column[i - 1]);
        }
    }
    return column[CAPACITY - 1];
}

static void output(void *self, double t, const double *x)
{
    slender_body_t *body = self;
    (void)t, (void)x;
    const double *v = body->inputs.velocity_air_body;
    const double across = sqrt(v[0] * v[0] + v[1] * v[1]);
    const double push = 0.5 * body->inputs.density * (across * across + v[2] * v[2]) * body->parameters.area;
    const double angle = across > 0.0 || v[2] != 0.0 ? cr_atan2(across, v[2]) : 0.0;
    const double normal = push * interpolated(body->parameters.angle, body->parameters.normal, angle);
    const double axial = push * interpolated(body->parameters.angle, body->parameters.axial, angle);
    double *force = body->outputs.force_body;
    force[0] = across > 0.0 ? -normal * (v[0] / across) : 0.0;
    force[1] = across > 0.0 ? -normal * (v[1] / across) : 0.0;
    force[2] = -axial;
    const double arm = body->parameters.centre_of_pressure - body->inputs.centre_of_mass_body[2];
    body->outputs.torque_body[0] = -arm * force[1];
    body->outputs.torque_body[1] = arm * force[0];
    body->outputs.torque_body[2] = 0.0;
    body->outputs.angle = angle;
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(slender_body_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(slender_body_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    VECTOR(INPUT, inputs.velocity_air_body, "m/s", "of the body through the air"),
    SCALAR(INPUT, inputs.density, "kg/m^3", ""),
    VECTOR(INPUT, inputs.centre_of_mass_body, "m", "from the origin of the centre of pressure"),
    VECTOR(TABLE, parameters.angle, "rad", "increasing, at most 40 rows; 0: tail first"),
    VECTOR(TABLE, parameters.axial, "", "coefficient along the axis, positive against motion along +z"),
    VECTOR(TABLE, parameters.normal, "", "coefficient across the axis"),
    SCALAR(PARAMETER, parameters.area, "m^2", "reference"),
    SCALAR(PARAMETER, parameters.centre_of_pressure, "m", "along z; negative: above the origin"),
    VECTOR(FEEDTHROUGH, outputs.force_body, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    SCALAR(FEEDTHROUGH, outputs.angle, "rad", "between axis and motion; 0: tail first"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "slender_body",
    .doc = "aerodynamic force of a body of revolution, from tables over its angle to the air",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(slender_body_t),
    .align = _Alignof(slender_body_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
