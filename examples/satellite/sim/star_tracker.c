/* SPDX-License-Identifier: Apache-2.0
 *
 * A star tracker: the attitude of a body against the stars, while it turns slowly.
 *
 *   sample = attitude exp(a / 2),  a = sigma_body n      a: small angles about the body axes, n: white
 *
 * There is no sample while `blinded` is set, while the body turns faster than max_rate, and with the probability of a
 * dropout. A random number is drawn at every update, so none of these changes a later sample.
 *
 * Source: F. L. Markley, J. L. Crassidis, Fundamentals of Spacecraft Attitude Determination and Control (2014),
 * section 4.2.
 *
 * Limits: no delay, no error of the mounting, no smear below max_rate. Sun and Earth in the field of view are left out.
 */
#include <math.h>
#include <stdbool.h>

#include "fcsl/fcsl_math.h"
#include "fcsl/fcsl_model.h"

enum { NOISE, DROPOUT };

typedef struct {
    struct {
        double attitude_body_to_inertial[4];
        double rate_body[3];
    } inputs;
    struct {
        double sigma_body[3];
        double max_rate;
        double dropout_probability;
        bool blinded;
    } parameters;
    struct {
        double attitude_body_to_inertial[4];
        bool sampled;
    } outputs;
} star_tracker_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    star_tracker_t *sensor = self;
    (void)context;
    for (int i = 0; i < 3; i++) {
        if (!(sensor->parameters.sigma_body[i] >= 0.0)) {
            return "parameters.sigma_body must not be negative";
        }
    }
    if (!(sensor->parameters.max_rate >= 0.0)) {
        return "parameters.max_rate must not be negative";
    }
    if (!(sensor->parameters.dropout_probability >= 0.0 && sensor->parameters.dropout_probability <= 1.0)) {
        return "parameters.dropout_probability must be from 0 to 1";
    }
    sensor->outputs.attitude_body_to_inertial[0] = 1.0;
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    star_tracker_t *sensor = self;
    const double *q = sensor->inputs.attitude_body_to_inertial;
    const double *w = sensor->inputs.rate_body;
    double v[3], square = 0.0;
    for (int i = 0; i < 3; i++) {
        v[i] = sensor->parameters.sigma_body[i] * context->gaussian(context->noise, NOISE);
        square += v[i] * v[i];
    }
    const bool is_lost = context->uniform(context->noise, DROPOUT) < sensor->parameters.dropout_probability;
    const double rate = sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    sensor->outputs.sampled = !(is_lost || sensor->parameters.blinded || rate > sensor->parameters.max_rate);
    if (!sensor->outputs.sampled) {
        return;
    }
    const double angle = sqrt(square), c = cr_cos(0.5 * angle);
    const double factor = angle > 0.0 ? cr_sin(0.5 * angle) / angle : 0.5;
    for (int i = 0; i < 3; i++) {
        v[i] *= factor;
    }
    double *s = sensor->outputs.attitude_body_to_inertial;
    s[0] = q[0] * c - q[1] * v[0] - q[2] * v[1] - q[3] * v[2];
    s[1] = q[0] * v[0] + q[1] * c + q[2] * v[2] - q[3] * v[1];
    s[2] = q[0] * v[1] - q[1] * v[2] + q[2] * c + q[3] * v[0];
    s[3] = q[0] * v[2] + q[1] * v[1] - q[2] * v[0] + q[3] * c;
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(star_tracker_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_inertial, "", "w, x, y, z"),
    FCSL_MODEL_VECTOR(star_tracker_t, FCSL_ROLE_INPUT, inputs.rate_body, "rad/s", "in the inertial frame"),
    FCSL_MODEL_VECTOR(star_tracker_t, FCSL_ROLE_PARAMETER, parameters.sigma_body, "rad", "noise about the body axes"),
    FCSL_MODEL_SCALAR(star_tracker_t, FCSL_ROLE_PARAMETER, parameters.max_rate, "rad/s", "faster: no samples"),
    FCSL_MODEL_SCALAR(star_tracker_t, FCSL_ROLE_PARAMETER, parameters.dropout_probability, "", "of each sample"),
    FCSL_MODEL_SCALAR(star_tracker_t, FCSL_ROLE_PARAMETER, parameters.blinded, "", "no samples while set"),
    FCSL_MODEL_VECTOR(star_tracker_t, FCSL_ROLE_OUTPUT, outputs.attitude_body_to_inertial, "", "the last sample"),
    FCSL_MODEL_SCALAR(star_tracker_t, FCSL_ROLE_OUTPUT, outputs.sampled, "", "the last update gave a sample"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "star_tracker",
    .doc = "a star tracker with noise, dropouts and a largest rate",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(star_tracker_t),
    .align = _Alignof(star_tracker_t),
    .sampled_offset = offsetof(star_tracker_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
