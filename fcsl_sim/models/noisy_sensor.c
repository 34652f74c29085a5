/* SPDX-License-Identifier: Apache-2.0
 *
 * A sensor of one scalar:  value = truth + bias + sigma * gaussian.
 *
 * Each update is one sample; its rate is the sensor's rate. While `dropout` is set there are no samples, and the value
 * keeps its last sample. The noise stream continues, so a dropout changes no later sample.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

enum { NOISE = 0 }; /* stream */

typedef struct {
    struct {
        double truth;
    } inputs;
    struct {
        double bias;
        double sigma;
        bool dropout;
    } parameters;
    struct {
        double value;
        bool sampled;
    } outputs;
} noisy_sensor_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    (void)context;
    const noisy_sensor_t *sensor = self;
    if (!(sensor->parameters.sigma >= 0.0)) {
        return "parameters.sigma must not be negative";
    }
    return NULL;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    noisy_sensor_t *sensor = self;
    const double error = sensor->parameters.bias + sensor->parameters.sigma * context->gaussian(context->noise, NOISE);
    sensor->outputs.sampled = !sensor->parameters.dropout;
    if (sensor->outputs.sampled) {
        sensor->outputs.value = sensor->inputs.truth + error;
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_INPUT, inputs.truth, "", "what is measured"),
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.bias, "", "constant error"),
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.sigma, "",
                      "standard deviation of the noise"),
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.dropout, "", "no samples while set"),
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_OUTPUT, outputs.value, "", "the last sample"),
    FCSL_MODEL_SCALAR(noisy_sensor_t, FCSL_ROLE_OUTPUT, outputs.sampled, "", "the last update took a sample"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "noisy_sensor",
    .doc = "a scalar sensor with bias, gaussian noise and dropouts",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(noisy_sensor_t),
    .align = _Alignof(noisy_sensor_t),
    .sampled_offset = offsetof(noisy_sensor_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
