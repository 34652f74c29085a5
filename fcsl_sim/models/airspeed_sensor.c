/* SPDX-License-Identifier: Apache-2.0
 *
 * A pitot tube: differential pressure, and the airspeeds that follow from its sample.
 *
 * differential_pressure = quantize(saturate((1 + scale_error) dynamic_pressure + bias + drift + sigma n))
 * indicated_airspeed    = sqrt(2 max(differential_pressure, 0) / 1.225 kg/m^3)
 * true_airspeed         = sqrt(2 max(differential_pressure, 0) / density)
 *
 * `drift` is the process of sensor_errors.h.
 *
 * Source: W. Gracey, Measurement of Aircraft Speed and Altitude, NASA RP-1046 (1980), incompressible; the
 * density is that of the U.S. Standard Atmosphere, 1976, at sea level.
 *
 * Limits: incompressible flow: at Mach 0.3 the true pressure is 2.3 % higher. The tube points into the wind, at any
 * angle of attack. No error of the static port, no dynamics of the tubes.
 */
#include "sensor_errors.h"

#define DENSITY_0 1.225 /* kg/m^3 */

typedef struct {
    double differential_pressure;
    double indicated_airspeed;
    double true_airspeed;
    bool sampled;
} airspeed_sensor_outputs_t;

typedef struct {
    struct {
        double dynamic_pressure;
        double density;
    } inputs;
    struct {
        double bias;
        double drift_sigma, drift_time_constant;
        double scale_error;
        double sigma;
        double saturation;
        double quantum;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        double drift;
        sensor_line_t line;
    } state;
    airspeed_sensor_outputs_t outputs;
} airspeed_sensor_t;

static sensor_errors_t errors_of(const airspeed_sensor_t *sensor)
{
    return (sensor_errors_t){.scale_error = sensor->parameters.scale_error,
                             .bias = sensor->parameters.bias,
                             .drift_sigma = sensor->parameters.drift_sigma,
                             .drift_time_constant = sensor->parameters.drift_time_constant,
                             .sigma = sensor->parameters.sigma,
                             .saturation = sensor->parameters.saturation,
                             .quantum = sensor->parameters.quantum};
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const airspeed_sensor_t *sensor = self;
    (void)context;
    const sensor_errors_t errors = errors_of(sensor);
    const char *wrong = sensor_check_errors(&errors);
    return wrong ? wrong : sensor_check_losses(SENSOR_LOSSES(sensor));
}

static double airspeed(double pressure, double density)
{
    return density > 0.0 ? sqrt(2.0 * fmax(0.0, pressure) / density) : 0.0;
}

static void update(void *self, const fcsl_model_context_t *context)
{
    airspeed_sensor_t *sensor = self;
    const sensor_losses_t losses = SENSOR_LOSSES(sensor);
    const sensor_errors_t errors = errors_of(sensor);
    const double interval = sensor_interval(&sensor->state.line, context);
    airspeed_sensor_outputs_t sample;
    sample.differential_pressure = sensor_measure(
        &errors, &sensor->state.drift, sensor_feel(losses, sensor->inputs.dynamic_pressure), interval, context);
    sample.indicated_airspeed = airspeed(sample.differential_pressure, DENSITY_0);
    sample.true_airspeed = airspeed(sample.differential_pressure, sensor->inputs.density);
    sensor->outputs.sampled = sensor_deliver(&sensor->state.line, losses, context, true, &sample, &sensor->outputs,
                                             offsetof(airspeed_sensor_outputs_t, sampled));
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(airspeed_sensor_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.dynamic_pressure, "Pa", ""),
    FIELD(OPTIONAL_INPUT, inputs.density, "kg/m^3", "of the air; for true_airspeed alone"),
    FIELD(OPTIONAL_PARAMETER, parameters.bias, "Pa", "constant error"),
    FIELD(OPTIONAL_PARAMETER, parameters.drift_sigma, "Pa", "of the correlated error"),
    FIELD(OPTIONAL_PARAMETER, parameters.drift_time_constant, "s", "of the correlated error"),
    FIELD(OPTIONAL_PARAMETER, parameters.scale_error, "", ""),
    FIELD(OPTIONAL_PARAMETER, parameters.sigma, "Pa", "white noise"),
    FIELD(OPTIONAL_PARAMETER, parameters.saturation, "Pa", "largest magnitude; 0: no limit"),
    FIELD(OPTIONAL_PARAMETER, parameters.quantum, "Pa", "step of the sample; 0: none"),
    FIELD(STATE, state.drift, "Pa", "correlated error"),
    FIELD(OUTPUT, outputs.differential_pressure, "Pa", ""),
    FIELD(OUTPUT, outputs.indicated_airspeed, "m/s", ""),
    FIELD(OUTPUT, outputs.true_airspeed, "m/s", "0 without a density"),
    SENSOR_FIELDS(airspeed_sensor_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "airspeed_sensor",
    .doc = "a pitot tube with noise, drift and limits, and its airspeeds",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(airspeed_sensor_t),
    .align = _Alignof(airspeed_sensor_t),
    .sampled_offset = offsetof(airspeed_sensor_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
