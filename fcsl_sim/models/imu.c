/* SPDX-License-Identifier: Apache-2.0
 *
 * An inertial measurement unit: three accelerometers and three gyroscopes, with their increments.
 *
 * a = f + w' x r + w x (w x r)                                  what is felt at the place r
 * sample(v) = quantize(saturate(s v - m x v + e))               s = 1 + scale_error, m: misalignment; v = a and v = w
 * e = bias + drift + walk + N sqrt(1 / T) n                     N: noise density
 * delta(v) = T sample(mean of v over T)                         with the same e
 *
 * T is the time since the last update. The means are integrals over it, which the simulator integrates. `drift` is the
 * process of sensor_errors.h (bias instability), `walk` a random walk (rate random walk).
 *
 * Sources: IEEE Std 952-1997 (R2008), annex C (N: angle random walk, K: rate random walk, Gauss-Markov process, their
 * Allan variances); D. Titterton, J. Weston, Strapdown Inertial Navigation Technology, 2nd ed. (2004), chapters 4, 6
 * and 11; P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed. (2013),
 * section 4.4.
 *
 * Limits: accelerometers at one point, no dynamics of the transducers, no influence of temperature or of acceleration
 * on the gyroscopes. The remainder of a quantized increment is not carried over. Increments are integrals in body axes
 * as they turn, without coning or sculling corrections.
 */
#include "sensor_errors.h"
#include "vectors.h"

enum { ACCELEROMETER_WALK = SENSOR_OWN_STREAM, GYROSCOPE_WALK, GYROSCOPE_NOISE, GYROSCOPE_DRIFT };

typedef struct {
    double noise_density;
    double bias_walk;
    double drift_sigma, drift_time_constant;
    double saturation, quantum;
    const double *bias, *scale_error, *misalignment;
    uint32_t noise_stream, drift_stream, walk_stream;
} triad_t;

typedef struct {
    double drift[3], walk[3];
} triad_state_t;

typedef struct {
    double accelerometer_body[3];
    double gyroscope_body[3];
    double delta_velocity_body[3];
    double delta_angle_body[3];
    bool sampled;
} imu_outputs_t;

typedef struct {
    struct {
        double specific_force_body[3];
        double rate_body[3];
        double angular_acceleration_body[3];
    } inputs;
    struct {
        double position_body[3];
        double accelerometer_noise_density, accelerometer_bias_walk;
        double accelerometer_drift_sigma, accelerometer_drift_time_constant;
        double accelerometer_bias[3], accelerometer_scale_error[3], accelerometer_misalignment[3];
        double accelerometer_saturation, accelerometer_quantum;
        double gyroscope_noise_density, gyroscope_bias_walk;
        double gyroscope_drift_sigma, gyroscope_drift_time_constant;
        double gyroscope_bias[3], gyroscope_scale_error[3], gyroscope_misalignment[3];
        double gyroscope_saturation, gyroscope_quantum;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        double velocity[3], angle[3]; /* integrated, from the last update on */
        triad_state_t accelerometer, gyroscope;
        sensor_line_t line;
    } state;
    imu_outputs_t outputs;
} imu_t;

static triad_t accelerometer_of(const imu_t *imu)
{
    return (triad_t){.noise_density = imu->parameters.accelerometer_noise_density,
                     .bias_walk = imu->parameters.accelerometer_bias_walk,
                     .drift_sigma = imu->parameters.accelerometer_drift_sigma,
                     .drift_time_constant = imu->parameters.accelerometer_drift_time_constant,
                     .saturation = imu->parameters.accelerometer_saturation,
                     .quantum = imu->parameters.accelerometer_quantum,
                     .bias = imu->parameters.accelerometer_bias,
                     .scale_error = imu->parameters.accelerometer_scale_error,
                     .misalignment = imu->parameters.accelerometer_misalignment,
                     .noise_stream = SENSOR_NOISE,
                     .drift_stream = SENSOR_DRIFT,
                     .walk_stream = ACCELEROMETER_WALK};
}

static triad_t gyroscope_of(const imu_t *imu)
{
    return (triad_t){.noise_density = imu->parameters.gyroscope_noise_density,
                     .bias_walk = imu->parameters.gyroscope_bias_walk,
                     .drift_sigma = imu->parameters.gyroscope_drift_sigma,
                     .drift_time_constant = imu->parameters.gyroscope_drift_time_constant,
                     .saturation = imu->parameters.gyroscope_saturation,
                     .quantum = imu->parameters.gyroscope_quantum,
                     .bias = imu->parameters.gyroscope_bias,
                     .scale_error = imu->parameters.gyroscope_scale_error,
                     .misalignment = imu->parameters.gyroscope_misalignment,
                     .noise_stream = GYROSCOPE_NOISE,
                     .drift_stream = GYROSCOPE_DRIFT,
                     .walk_stream = GYROSCOPE_WALK};
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const imu_t *imu = self;
    (void)context;
#define CHECK(name)                                                                                                    \
    if (!(imu->parameters.name >= 0.0)) {                                                                              \
        return "parameters." #name " must not be negative";                                                            \
    }
    CHECK(accelerometer_noise_density)
    CHECK(accelerometer_bias_walk)
    CHECK(accelerometer_drift_sigma)
    CHECK(accelerometer_drift_time_constant)
    CHECK(accelerometer_saturation)
    CHECK(accelerometer_quantum)
    CHECK(gyroscope_noise_density)
    CHECK(gyroscope_bias_walk)
    CHECK(gyroscope_drift_sigma)
    CHECK(gyroscope_drift_time_constant)
    CHECK(gyroscope_saturation)
    CHECK(gyroscope_quantum)
#undef CHECK
    return sensor_check_losses(SENSOR_LOSSES(imu));
}

/* The specific force at the place of the accelerometers. */
static void felt_force(const imu_t *imu, double *force)
{
    const double *place = imu->parameters.position_body;
    double turn[3], centripetal[3], tangential[3];
    vector_cross(imu->inputs.rate_body, place, turn);
    vector_cross(imu->inputs.rate_body, turn, centripetal);
    vector_cross(imu->inputs.angular_acceleration_body, place, tangential);
    for (int i = 0; i < 3; i++) {
        force[i] = imu->inputs.specific_force_body[i] + tangential[i] + centripetal[i];
    }
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const imu_t *imu = self;
    (void)t, (void)x;
    felt_force(imu, dx);
    for (int i = 0; i < 3; i++) {
        dx[3 + i] = imu->inputs.rate_body[i];
    }
}

/* A model with integrated states has this function. `update` writes all outputs. */
static void output(void *self, double t, const double *x)
{
    (void)self, (void)t, (void)x;
}

/* The errors that are added to the next sample. */
static void next_errors(const triad_t *triad, triad_state_t *state, double interval,
                        const fcsl_model_context_t *context, double *error)
{
    const double step = isfinite(interval) ? triad->bias_walk * sqrt(interval) : 0.0;
    const double sigma = triad->noise_density * sqrt(1.0 / interval);
    for (int i = 0; i < 3; i++) {
        (void)sensor_drift(&state->drift[i], triad->drift_sigma, triad->drift_time_constant, interval,
                           sensor_gaussian(context, triad->drift_stream));
        state->walk[i] += step * sensor_gaussian(context, triad->walk_stream);
        error[i] =
            triad->bias[i] + state->drift[i] + state->walk[i] + sigma * sensor_gaussian(context, triad->noise_stream);
    }
}

static void measure(const triad_t *triad, const double *truth, const double *error, double *measured)
{
    double turned[3];
    vector_cross(triad->misalignment, truth, turned);
    for (int i = 0; i < 3; i++) {
        const double value = truth[i] + triad->scale_error[i] * truth[i] - turned[i] + error[i];
        measured[i] = sensor_quantize(sensor_saturate(value, triad->saturation), triad->quantum);
    }
}

/* One triad: its sample, and its increment from the integral since the last update, which begins anew. */
static void sample_triad(const triad_t *triad, triad_state_t *state, sensor_losses_t losses, double interval,
                         const fcsl_model_context_t *context, const double *truth, double *integral, double *sample,
                         double *delta)
{
    double now[3], mean[3], error[3], mean_measured[3];
    for (int i = 0; i < 3; i++) {
        now[i] = sensor_feel(losses, truth[i]);
        mean[i] = sensor_feel(losses, integral[i] / interval);
        integral[i] = 0.0;
    }
    next_errors(triad, state, interval, context, error);
    measure(triad, now, error, sample);
    measure(triad, mean, error, mean_measured);
    for (int i = 0; i < 3; i++) {
        delta[i] = isfinite(interval) ? interval * mean_measured[i] : 0.0;
    }
}

static void update(void *self, const fcsl_model_context_t *context)
{
    imu_t *imu = self;
    const triad_t accelerometer = accelerometer_of(imu), gyroscope = gyroscope_of(imu);
    const sensor_losses_t losses = SENSOR_LOSSES(imu);
    const double interval = sensor_interval(&imu->state.line, context);
    double force[3];
    imu_outputs_t sample;
    felt_force(imu, force);
    sample_triad(&accelerometer, &imu->state.accelerometer, losses, interval, context, force, imu->state.velocity,
                 sample.accelerometer_body, sample.delta_velocity_body);
    sample_triad(&gyroscope, &imu->state.gyroscope, losses, interval, context, imu->inputs.rate_body, imu->state.angle,
                 sample.gyroscope_body, sample.delta_angle_body);
    imu->outputs.sampled = sensor_deliver(&imu->state.line, losses, context, true, &sample, &imu->outputs,
                                          offsetof(imu_outputs_t, sampled));
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(imu_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(imu_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    VECTOR(INPUT, inputs.specific_force_body, "m/s^2", "at the centre of mass"),
    VECTOR(INPUT, inputs.rate_body, "rad/s", "in the inertial frame"),
    VECTOR(OPTIONAL_INPUT, inputs.angular_acceleration_body, "rad/s^2", "for the lever arm"),
    VECTOR(OPTIONAL_PARAMETER, parameters.position_body, "m", "of the accelerometers, from the centre of mass"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_noise_density, "m/s^2/sqrt(Hz)", "velocity random walk"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_bias_walk, "m/s^3/sqrt(Hz)", "acceleration random walk"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_drift_sigma, "m/s^2", "of the Gauss-Markov part of the bias"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_drift_time_constant, "s", "of that part"),
    VECTOR(OPTIONAL_PARAMETER, parameters.accelerometer_bias, "m/s^2", "its constant part"),
    VECTOR(OPTIONAL_PARAMETER, parameters.accelerometer_scale_error, "", ""),
    VECTOR(OPTIONAL_PARAMETER, parameters.accelerometer_misalignment, "rad",
           "small turn from body axes to those of the sensor"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_saturation, "m/s^2",
           "largest magnitude of an axis; 0: no limit"),
    SCALAR(OPTIONAL_PARAMETER, parameters.accelerometer_quantum, "m/s^2", "step of the sample; 0: none"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_noise_density, "rad/s/sqrt(Hz)", "angle random walk"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_bias_walk, "rad/s^2/sqrt(Hz)", "rate random walk"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_drift_sigma, "rad/s", "of the Gauss-Markov part of the bias"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_drift_time_constant, "s", "of that part"),
    VECTOR(OPTIONAL_PARAMETER, parameters.gyroscope_bias, "rad/s", "its constant part"),
    VECTOR(OPTIONAL_PARAMETER, parameters.gyroscope_scale_error, "", ""),
    VECTOR(OPTIONAL_PARAMETER, parameters.gyroscope_misalignment, "rad",
           "small turn from body axes to those of the sensor"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_saturation, "rad/s", "largest magnitude of an axis; 0: no limit"),
    SCALAR(OPTIONAL_PARAMETER, parameters.gyroscope_quantum, "rad/s", "step of the sample; 0: none"),
    VECTOR(STATE, state.velocity, "m/s", "since the last update"),
    VECTOR(STATE, state.angle, "rad", "since the last update"),
    VECTOR(STATE, state.accelerometer.drift, "m/s^2", "Gauss-Markov part of the bias"),
    VECTOR(STATE, state.accelerometer.walk, "m/s^2", "random walk of the bias"),
    VECTOR(STATE, state.gyroscope.drift, "rad/s", "Gauss-Markov part of the bias"),
    VECTOR(STATE, state.gyroscope.walk, "rad/s", "random walk of the bias"),
    VECTOR(OUTPUT, outputs.accelerometer_body, "m/s^2", "specific force at the time of the sample"),
    VECTOR(OUTPUT, outputs.gyroscope_body, "rad/s", "rate at the time of the sample"),
    VECTOR(OUTPUT, outputs.delta_velocity_body, "m/s", "integral since the sample before"),
    VECTOR(OUTPUT, outputs.delta_angle_body, "rad", "integral since the sample before"),
    SENSOR_FIELDS(imu_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "imu",
    .doc = "accelerometers and gyroscopes with noise, drifting bias, scale error, misalignment and limits",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(imu_t),
    .align = _Alignof(imu_t),
    .continuous_offset = offsetof(imu_t, state),
    .continuous_count = 6,
    .sampled_offset = offsetof(imu_t, outputs.sampled),
    .init = init,
    .derivative = derivative,
    .output = output,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
