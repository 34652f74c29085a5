/* SPDX-License-Identifier: Apache-2.0
 *
 * A barometer, and the pressure altitude that follows from its sample.
 *
 * pressure = quantize(pressure + bias + drift + sigma n)        drift: sensor_errors.h
 * height   = T0 / L (1 - (pressure / reference_pressure)^(R L / (g0 M)))
 *
 * Source: U.S. Standard Atmosphere, 1976 (NOAA-S/T 76-1562), equation 33a and tables 2 and 4: the layer up to 11 km.
 *
 * Limits: no dynamics of the static port, no wind on it. The height is geopotential, of an atmosphere of 288.15 K at
 * the reference pressure. Above 11 km the formula is not that of the standard.
 */
#include "sensor_errors.h"

#define TEMPERATURE_0 288.15  /* K */
#define LAPSE_RATE    0.0065  /* K/m */
#define GRAVITY_0     9.80665 /* m/s^2 */
#define GAS_CONSTANT  8.31432 /* J/(mol K) */
#define MOLAR_MASS    0.0289644
#define EXPONENT      (GAS_CONSTANT * LAPSE_RATE / (GRAVITY_0 * MOLAR_MASS))

typedef struct {
    double pressure;
    double height;
    bool sampled;
} barometer_outputs_t;

typedef struct {
    struct {
        double pressure;
    } inputs;
    struct {
        double reference_pressure;
        double bias;
        double drift_sigma, drift_time_constant;
        double sigma;
        double quantum;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        double drift;
        sensor_line_t line;
    } state;
    barometer_outputs_t outputs;
} barometer_t;

static sensor_errors_t errors_of(const barometer_t *sensor)
{
    return (sensor_errors_t){.bias = sensor->parameters.bias,
                             .drift_sigma = sensor->parameters.drift_sigma,
                             .drift_time_constant = sensor->parameters.drift_time_constant,
                             .sigma = sensor->parameters.sigma,
                             .quantum = sensor->parameters.quantum};
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const barometer_t *sensor = self;
    (void)context;
    const sensor_errors_t errors = errors_of(sensor);
    const char *wrong = sensor_check_errors(&errors);
    if (!(sensor->parameters.reference_pressure > 0.0)) {
        return "parameters.reference_pressure must be positive";
    }
    return wrong ? wrong : sensor_check_losses(SENSOR_LOSSES(sensor));
}

static void update(void *self, const fcsl_model_context_t *context)
{
    barometer_t *sensor = self;
    const sensor_losses_t losses = SENSOR_LOSSES(sensor);
    const sensor_errors_t errors = errors_of(sensor);
    const double interval = sensor_interval(&sensor->state.line, context);
    barometer_outputs_t sample;
    sample.pressure =
        sensor_measure(&errors, &sensor->state.drift, sensor_feel(losses, sensor->inputs.pressure), interval, context);
    const double ratio = fmax(0.0, sample.pressure / sensor->parameters.reference_pressure);
    sample.height = TEMPERATURE_0 / LAPSE_RATE * (1.0 - cr_pow(ratio, EXPONENT));
    sensor->outputs.sampled = sensor_deliver(&sensor->state.line, losses, context, true, &sample, &sensor->outputs,
                                             offsetof(barometer_outputs_t, sampled));
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(barometer_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FIELD(INPUT, inputs.pressure, "Pa", "static"),
    FIELD(PARAMETER, parameters.reference_pressure, "Pa", "where the height is zero; 101325: the standard"),
    FIELD(OPTIONAL_PARAMETER, parameters.bias, "Pa", "constant error"),
    FIELD(OPTIONAL_PARAMETER, parameters.drift_sigma, "Pa", "of the correlated error"),
    FIELD(OPTIONAL_PARAMETER, parameters.drift_time_constant, "s", "of the correlated error"),
    FIELD(OPTIONAL_PARAMETER, parameters.sigma, "Pa", "white noise"),
    FIELD(OPTIONAL_PARAMETER, parameters.quantum, "Pa", "step of the sample; 0: none"),
    FIELD(STATE, state.drift, "Pa", "correlated error"),
    FIELD(OUTPUT, outputs.pressure, "Pa", ""),
    FIELD(OUTPUT, outputs.height, "m", "pressure altitude"),
    SENSOR_FIELDS(barometer_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "barometer",
    .doc = "a barometer with noise and drift, and its pressure altitude",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(barometer_t),
    .align = _Alignof(barometer_t),
    .sampled_offset = offsetof(barometer_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
