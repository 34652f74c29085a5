/* SPDX-License-Identifier: Apache-2.0
 *
 * A receiver of satellite navigation: position and velocity with white and correlated errors, late.
 *
 * error_ned = bias + drift + sigma n
 * latitude += error_north / (M + height)                        M = a (1 - e^2) / (1 - e^2 sin^2 latitude)^(3/2)
 * longitude += error_east / ((N + height) cos latitude)         N = a / sqrt(1 - e^2 sin^2 latitude)
 * height -= error_down
 * position_ned = ((M0 + h0) (latitude - latitude0), (N0 + h0) cos latitude0 (longitude - longitude0), h0 - height)
 *
 * `drift` is the process of sensor_errors.h; M0, N0, h0 are those of the reference.
 *
 * Sources: P. D. Groves, Principles of GNSS, Inertial, and Multisensor Integrated Navigation Systems, 2nd ed. (2013),
 * section 2.4 (radii of curvature) and chapter 9 (errors); NIMA TR8350.2, World Geodetic System 1984, 3rd ed. (2000),
 * table 3.1.
 *
 * Limits: errors do not depend on satellites, sky or motion. No lever arm of the antenna. The local position is linear
 * in latitude and longitude. Not for a pole.
 */
#include "sensor_errors.h"

#define SEMI_MAJOR_AXIS      6378137.0 /* m */
#define FLATTENING           (1.0 / 298.257223563)
#define ECCENTRICITY_SQUARED (FLATTENING * (2.0 - FLATTENING))
#define PI                   3.14159265358979323846

enum { VELOCITY_NOISE = SENSOR_OWN_STREAM };

typedef struct {
    double latitude, longitude, height;
    double velocity_ned[3];
    double position_ned[3];
    bool sampled;
} gnss_outputs_t;

typedef struct {
    struct {
        double latitude, longitude, height;
        double velocity_ned[3];
    } inputs;
    struct {
        double reference_latitude, reference_longitude, reference_height;
        double bias_ned[3];
        double horizontal_sigma, vertical_sigma;
        double horizontal_drift_sigma, vertical_drift_sigma;
        double drift_time_constant;
        double horizontal_velocity_sigma, vertical_velocity_sigma;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        double drift_ned[3];
        sensor_line_t line;
    } state;
    gnss_outputs_t outputs;
} gnss_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const gnss_t *gnss = self;
    (void)context;
#define CHECK(name)                                                                                                    \
    if (!(gnss->parameters.name >= 0.0)) {                                                                             \
        return "parameters." #name " must not be negative";                                                            \
    }
    CHECK(horizontal_sigma)
    CHECK(vertical_sigma)
    CHECK(horizontal_drift_sigma)
    CHECK(vertical_drift_sigma)
    CHECK(drift_time_constant)
    CHECK(horizontal_velocity_sigma)
    CHECK(vertical_velocity_sigma)
#undef CHECK
    if (!(fabs(gnss->parameters.reference_latitude) < 0.5 * PI)) {
        return "parameters.reference_latitude must be between the poles, in rad";
    }
    return sensor_check_losses(SENSOR_LOSSES(gnss));
}

/* Metres per radian of latitude and of longitude. */
static void scales(double latitude, double height, double *north, double *east)
{
    const double sine = cr_sin(latitude);
    const double w = 1.0 - ECCENTRICITY_SQUARED * sine * sine;
    const double meridian = SEMI_MAJOR_AXIS * (1.0 - ECCENTRICITY_SQUARED) / (w * sqrt(w));
    const double normal = SEMI_MAJOR_AXIS / sqrt(w);
    *north = meridian + height;
    *east = (normal + height) * cr_cos(latitude);
}

/* An angle within half a turn of 0. */
static double wrap(double angle)
{
    return angle - 2.0 * PI * round(angle / (2.0 * PI));
}

static void update(void *self, const fcsl_model_context_t *context)
{
    gnss_t *gnss = self;
    const sensor_losses_t losses = SENSOR_LOSSES(gnss);
    const double interval = sensor_interval(&gnss->state.line, context);
    const double sigma[] = {gnss->parameters.horizontal_sigma, gnss->parameters.horizontal_sigma,
                            gnss->parameters.vertical_sigma};
    const double drift_sigma[] = {gnss->parameters.horizontal_drift_sigma, gnss->parameters.horizontal_drift_sigma,
                                  gnss->parameters.vertical_drift_sigma};
    const double velocity_sigma[] = {gnss->parameters.horizontal_velocity_sigma,
                                     gnss->parameters.horizontal_velocity_sigma,
                                     gnss->parameters.vertical_velocity_sigma};
    double error[3], north, east;
    gnss_outputs_t sample;
    for (int i = 0; i < 3; i++) {
        const sensor_errors_t errors = {.bias = gnss->parameters.bias_ned[i],
                                        .drift_sigma = drift_sigma[i],
                                        .drift_time_constant = gnss->parameters.drift_time_constant,
                                        .sigma = sigma[i]};
        error[i] = sensor_measure(&errors, &gnss->state.drift_ned[i], 0.0, interval, context);
        sample.velocity_ned[i] = sensor_feel(losses, gnss->inputs.velocity_ned[i]) +
                                 velocity_sigma[i] * sensor_gaussian(context, VELOCITY_NOISE);
    }
    const double latitude = sensor_feel(losses, gnss->inputs.latitude);
    const double height = sensor_feel(losses, gnss->inputs.height);
    scales(latitude, height, &north, &east);
    sample.latitude = fmax(-0.5 * PI, fmin(0.5 * PI, latitude + error[0] / north));
    sample.longitude = wrap(sensor_feel(losses, gnss->inputs.longitude) + error[1] / east);
    sample.height = height - error[2];

    scales(gnss->parameters.reference_latitude, gnss->parameters.reference_height, &north, &east);
    sample.position_ned[0] = north * (sample.latitude - gnss->parameters.reference_latitude);
    sample.position_ned[1] = east * wrap(sample.longitude - gnss->parameters.reference_longitude);
    sample.position_ned[2] = gnss->parameters.reference_height - sample.height;
    gnss->outputs.sampled = sensor_deliver(&gnss->state.line, losses, context, true, &sample, &gnss->outputs,
                                           offsetof(gnss_outputs_t, sampled));
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(gnss_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(gnss_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.latitude, "rad", "geodetic"),
    SCALAR(INPUT, inputs.longitude, "rad", ""),
    SCALAR(INPUT, inputs.height, "m", "above the ellipsoid"),
    VECTOR(INPUT, inputs.velocity_ned, "m/s", "over ground"),
    SCALAR(PARAMETER, parameters.reference_latitude, "rad", "where position_ned is zero"),
    SCALAR(PARAMETER, parameters.reference_longitude, "rad", ""),
    SCALAR(PARAMETER, parameters.reference_height, "m", ""),
    VECTOR(OPTIONAL_PARAMETER, parameters.bias_ned, "m", "constant error"),
    SCALAR(OPTIONAL_PARAMETER, parameters.horizontal_sigma, "m", "white error of north, and of east"),
    SCALAR(OPTIONAL_PARAMETER, parameters.vertical_sigma, "m", ""),
    SCALAR(OPTIONAL_PARAMETER, parameters.horizontal_drift_sigma, "m", "correlated error of north, and of east"),
    SCALAR(OPTIONAL_PARAMETER, parameters.vertical_drift_sigma, "m", ""),
    SCALAR(OPTIONAL_PARAMETER, parameters.drift_time_constant, "s", "of the correlated errors"),
    SCALAR(OPTIONAL_PARAMETER, parameters.horizontal_velocity_sigma, "m/s", "white error of north, and of east"),
    SCALAR(OPTIONAL_PARAMETER, parameters.vertical_velocity_sigma, "m/s", ""),
    VECTOR(STATE, state.drift_ned, "m", "correlated errors"),
    SCALAR(OUTPUT, outputs.latitude, "rad", ""),
    SCALAR(OUTPUT, outputs.longitude, "rad", "from -pi to pi"),
    SCALAR(OUTPUT, outputs.height, "m", "above the ellipsoid"),
    VECTOR(OUTPUT, outputs.velocity_ned, "m/s", ""),
    VECTOR(OUTPUT, outputs.position_ned, "m", "from the reference"),
    SENSOR_FIELDS(gnss_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "gnss",
    .doc = "a satellite navigation receiver with white and correlated errors, and delay",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(gnss_t),
    .align = _Alignof(gnss_t),
    .sampled_offset = offsetof(gnss_t, outputs.sampled),
    .init = init,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
