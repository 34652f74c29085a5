/* SPDX-License-Identifier: Apache-2.0
 *
 * A magnetometer of three axes, fixed to a body that is magnetic itself.
 *
 * sample = quantize(saturate(soft_iron R' B + hard_iron + sigma n))       R turns body axes to north, east, down
 *
 * Source: P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed. (2013),
 * section 6.1.1.
 *
 * Limits: the iron is constant. Currents on board are no part of it. Scale errors and misalignment are part of
 * `soft_iron`.
 */
#include "sensor_errors.h"
#include "vectors.h"

typedef struct {
    double magnetic_field_body[3];
    bool sampled;
} magnetometer_outputs_t;

typedef struct {
    struct {
        double magnetic_field_ned[3];
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double hard_iron_body[3];
        double soft_iron[3][3];
        double sigma;
        double saturation;
        double quantum;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        sensor_line_t line;
    } state;
    magnetometer_outputs_t outputs;
} magnetometer_t;

static sensor_errors_t errors_of(const magnetometer_t *sensor, int axis)
{
    return (sensor_errors_t){.bias = sensor->parameters.hard_iron_body[axis],
                             .sigma = sensor->parameters.sigma,
                             .saturation = sensor->parameters.saturation,
                             .quantum = sensor->parameters.quantum};
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const magnetometer_t *sensor = self;
    (void)context;
    const sensor_errors_t errors = errors_of(sensor, 0);
    const char *wrong = sensor_check_errors(&errors);
    return wrong ? wrong : sensor_check_losses(SENSOR_LOSSES(sensor));
}

static void update(void *self, const fcsl_model_context_t *context)
{
    magnetometer_t *sensor = self;
    const magnetometer_t *now = sensor;
    const sensor_losses_t losses = SENSOR_LOSSES(sensor);
    const double interval = sensor_interval(&sensor->state.line, context);
    double field[3], felt[3];
    magnetometer_outputs_t sample;
    quaternion_rotate_back(now->inputs.attitude_body_to_ned, now->inputs.magnetic_field_ned, field);
    matrix_times(now->parameters.soft_iron, field, felt);
    for (int i = 0; i < 3; i++) {
        const sensor_errors_t errors = errors_of(sensor, i);
        double drift = 0.0; /* it has none */
        sample.magnetic_field_body[i] =
            sensor_measure(&errors, &drift, sensor_feel(losses, felt[i]), interval, context);
    }
    sensor->outputs.sampled = sensor_deliver(&sensor->state.line, losses, context, true, &sample, &sensor->outputs,
                                             offsetof(magnetometer_outputs_t, sampled));
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(magnetometer_t, FCSL_ROLE_INPUT, inputs.magnetic_field_ned, "T", "flux density"),
    FCSL_MODEL_VECTOR(magnetometer_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "unit quaternion, w, x, y, z"),
    FCSL_MODEL_VECTOR(magnetometer_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.hard_iron_body, "T", "constant error"),
    FCSL_MODEL_MATRIX(magnetometer_t, FCSL_ROLE_PARAMETER, parameters.soft_iron, "", "identity: none"),
    FCSL_MODEL_SCALAR(magnetometer_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.sigma, "T", "white noise of each axis"),
    FCSL_MODEL_SCALAR(magnetometer_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.saturation, "T",
                      "largest magnitude of an axis; 0: no limit"),
    FCSL_MODEL_SCALAR(magnetometer_t, FCSL_ROLE_OPTIONAL_PARAMETER, parameters.quantum, "T",
                      "step of the sample; 0: none"),
    FCSL_MODEL_VECTOR(magnetometer_t, FCSL_ROLE_OUTPUT, outputs.magnetic_field_body, "T", ""),
    SENSOR_FIELDS(magnetometer_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "magnetometer",
    .doc = "a magnetometer with hard and soft iron, noise and limits",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(magnetometer_t),
    .align = _Alignof(magnetometer_t),
    .sampled_offset = offsetof(magnetometer_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
