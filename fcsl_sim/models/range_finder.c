/* SPDX-License-Identifier: Apache-2.0
 *
 * A range finder, fixed to a body: the distance to flat ground along its beam.
 *
 * range = height_above_ground / (R beam)_down                   |beam| = 1; R turns body axes to north, east, down
 * sample = quantize((1 + scale_error) range + bias + sigma n)
 *
 * There is no sample while the beam does not point downwards, or while the sample is not within minimum_range and
 * maximum_range.
 *
 * Source: geometry.
 *
 * Limits: the ground is a horizontal plane, the beam has no width, the sensor is at the origin of the body. It does not
 * weaken with the distance or the angle.
 */
#include "sensor_errors.h"
#include "vectors.h"

typedef struct {
    double range;
    bool sampled;
} range_finder_outputs_t;

typedef struct {
    struct {
        double height_above_ground;
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double beam_body[3];
        double minimum_range, maximum_range;
        double bias;
        double scale_error;
        double sigma;
        double quantum;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        sensor_line_t line;
    } state;
    range_finder_outputs_t outputs;
} range_finder_t;

static sensor_errors_t errors_of(const range_finder_t *sensor)
{
    return (sensor_errors_t){.bias = sensor->parameters.bias,
                             .scale_error = sensor->parameters.scale_error,
                             .sigma = sensor->parameters.sigma,
                             .quantum = sensor->parameters.quantum};
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const range_finder_t *sensor = self;
    (void)context;
    const sensor_errors_t errors = errors_of(sensor);
    const char *wrong = sensor_check_errors(&errors);
    if (!(vector_norm(sensor->parameters.beam_body) > 0.0)) {
        return "parameters.beam_body must not be zero";
    }
    if (!(sensor->parameters.minimum_range >= 0.0)) {
        return "parameters.minimum_range must not be negative";
    }
    if (!(sensor->parameters.maximum_range > sensor->parameters.minimum_range)) {
        return "parameters.maximum_range must exceed parameters.minimum_range";
    }
    return wrong ? wrong : sensor_check_losses(SENSOR_LOSSES(sensor));
}

static void update(void *self, const fcsl_model_context_t *context)
{
    range_finder_t *sensor = self;
    const sensor_losses_t losses = SENSOR_LOSSES(sensor);
    const sensor_errors_t errors = errors_of(sensor);
    const double interval = sensor_interval(&sensor->state.line, context);
    double beam_ned[3], drift = 0.0; /* it has none */
    quaternion_rotate(sensor->inputs.attitude_body_to_ned, sensor->parameters.beam_body, beam_ned);
    const double down = beam_ned[2] / vector_norm(sensor->parameters.beam_body);
    const bool sees_ground = down > 0.0 && sensor->inputs.height_above_ground >= 0.0;
    const double truth = sees_ground ? sensor->inputs.height_above_ground / down : 0.0;
    range_finder_outputs_t sample;
    sample.range = sensor_measure(&errors, &drift, sensor_feel(losses, truth), interval, context);
    const bool is_valid = sees_ground && sample.range >= sensor->parameters.minimum_range &&
                          sample.range <= sensor->parameters.maximum_range;
    sensor->outputs.sampled = sensor_deliver(&sensor->state.line, losses, context, is_valid, &sample, &sensor->outputs,
                                             offsetof(range_finder_outputs_t, sampled));
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(range_finder_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.height_above_ground, "m", "of the sensor"),
    FCSL_MODEL_VECTOR(range_finder_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "unit quaternion, w, x, y, z"),
    FCSL_MODEL_VECTOR(range_finder_t, FCSL_ROLE_PARAMETER, parameters.beam_body, "",
                      "direction, of any length; 0, 0, 1: down"),
    FIELD(PARAMETER, parameters.minimum_range, "m", "no sample below"),
    FIELD(PARAMETER, parameters.maximum_range, "m", "no sample above"),
    FIELD(OPTIONAL_PARAMETER, parameters.bias, "m", "constant error"),
    FIELD(OPTIONAL_PARAMETER, parameters.scale_error, "", ""),
    FIELD(OPTIONAL_PARAMETER, parameters.sigma, "m", "white noise"),
    FIELD(OPTIONAL_PARAMETER, parameters.quantum, "m", "step of the sample; 0: none"),
    FIELD(OUTPUT, outputs.range, "m", "along the beam"),
    SENSOR_FIELDS(range_finder_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "range_finder",
    .doc = "a range finder over flat ground, with noise and a minimum and maximum range",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(range_finder_t),
    .align = _Alignof(range_finder_t),
    .sampled_offset = offsetof(range_finder_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
