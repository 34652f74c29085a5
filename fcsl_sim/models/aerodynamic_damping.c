/* SPDX-License-Identifier: Apache-2.0
 *
 * The torques by which air damps the rotation of a body.
 *
 * With dynamic pressure Q = density V^2 / 2 and rates (p, q, r) in the air:
 * torque = Q area (span clp p span / (2 V), chord cmq q chord / (2 V), span cnr r span / (2 V))
 *        = density V area / 4 (span^2 clp p, chord^2 cmq q, span^2 cnr r),  which is 0 at zero airspeed
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 2.3.
 */
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double density, airspeed;
        double rate_body[3];
        double gust_rate_body[3];
    } inputs;
    struct {
        double area, span, chord, clp, cmq, cnr;
    } parameters;
    struct {
        double torque_body[3];
    } outputs;
} aerodynamic_damping_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const aerodynamic_damping_t *damping = self;
    (void)context;
    if (!(damping->parameters.area >= 0.0)) {
        return "parameters.area must not be negative";
    }
    if (!(damping->parameters.span >= 0.0)) {
        return "parameters.span must not be negative";
    }
    if (!(damping->parameters.chord >= 0.0)) {
        return "parameters.chord must not be negative";
    }
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    aerodynamic_damping_t *damping = self;
    (void)t, (void)x;
    const double span = damping->parameters.span, chord = damping->parameters.chord;
    const double coefficient[3] = {damping->parameters.clp, damping->parameters.cmq, damping->parameters.cnr};
    const double length[3] = {span, chord, span};
    const double factor = 0.25 * damping->inputs.density * damping->inputs.airspeed * damping->parameters.area;
    for (int i = 0; i < 3; i++) {
        const double rate = damping->inputs.rate_body[i] - damping->inputs.gust_rate_body[i];
        damping->outputs.torque_body[i] = factor * length[i] * length[i] * coefficient[i] * rate;
    }
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(aerodynamic_damping_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(aerodynamic_damping_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.density, "kg/m^3", ""),
    SCALAR(INPUT, inputs.airspeed, "m/s", ""),
    VECTOR(INPUT, inputs.rate_body, "rad/s", "of the body over ground"),
    VECTOR(OPTIONAL_INPUT, inputs.gust_rate_body, "rad/s", "of the air"),
    SCALAR(PARAMETER, parameters.area, "m^2", "reference area"),
    SCALAR(PARAMETER, parameters.span, "m", "reference length of roll and yaw"),
    SCALAR(PARAMETER, parameters.chord, "m", "reference length of pitch"),
    SCALAR(PARAMETER, parameters.clp, "", "by p span / (2 V); negative: it damps"),
    SCALAR(PARAMETER, parameters.cmq, "", "by q chord / (2 V)"),
    SCALAR(PARAMETER, parameters.cnr, "", "by r span / (2 V)"),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "aerodynamic_damping",
    .doc = "the torques by which air damps the rotation of a body",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(aerodynamic_damping_t),
    .align = _Alignof(aerodynamic_damping_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
