/* SPDX-License-Identifier: Apache-2.0
 *
 * A flat Earth that does not turn: the inertial axes are north, east, down at an origin on it.
 *
 * Gravity is constant. Latitude and longitude follow from the radii of curvature of the WGS-84 ellipsoid at the origin:
 * the meridian M and the normal N,  latitude = latitude_0 + north / (M + h_0),  longitude = longitude_0 + east / ((N + h_0)
 * cos latitude_0). Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016),
 * section 1.6. Limits: some kilometres around the origin, not at a pole.
 */
#include "earth.h"

static const ellipsoid_t WGS84 = {6378137.0, 1.0 / 298.257223563, 0.0};

typedef struct {
    earth_inputs_t inputs;
    struct {
        double gravity, latitude, longitude, height;
    } parameters;
    struct {
        double metres_per_latitude, metres_per_longitude; /* m/rad */
    } state;
    struct {
        double gravity_inertial[3];
        double latitude, longitude, height;
        double position_ned[3];
        double velocity_ned[3];
        double attitude_body_to_ned[4];
        double rate_over_ground_body[3];
        double gravity;
    } outputs;
} earth_flat_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    earth_flat_t *earth = self;
    (void)context;
    if (!(fabs(earth->parameters.latitude) < 1.5533)) { /* 89 degrees */
        return "parameters.latitude must be within 1.5533 rad (89 degrees) of the equator";
    }
    const double squared = WGS84.flattening * (2.0 - WGS84.flattening);
    const double sine = cr_sin(earth->parameters.latitude);
    const double w = 1.0 - squared * sine * sine;
    const double normal = WGS84.equatorial_radius / sqrt(w);
    const double meridian = normal * (1.0 - squared) / w;
    earth->state.metres_per_latitude = meridian + earth->parameters.height;
    earth->state.metres_per_longitude = (normal + earth->parameters.height) * cr_cos(earth->parameters.latitude);
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    earth_flat_t *earth = self;
    (void)t, (void)x;
    for (int i = 0; i < 3; i++) {
        earth->outputs.gravity_inertial[i] = i == 2 ? earth->parameters.gravity : 0.0;
        earth->outputs.position_ned[i] = earth->inputs.position_inertial[i];
        earth->outputs.velocity_ned[i] = earth->inputs.velocity_inertial[i];
        earth->outputs.rate_over_ground_body[i] = earth->inputs.rate_body[i];
    }
    earth->outputs.gravity = earth->parameters.gravity;
    const double *position = earth->inputs.position_inertial;
    earth->outputs.latitude = earth->parameters.latitude + position[0] / earth->state.metres_per_latitude;
    earth->outputs.longitude = earth->parameters.longitude + position[1] / earth->state.metres_per_longitude;
    earth->outputs.height = earth->parameters.height - position[2];
    earth_attitude(earth->inputs.attitude_body_to_inertial, earth->outputs.attitude_body_to_ned);
}

static const fcsl_field_t fields[] = {
    EARTH_FIELDS(earth_flat_t),
    FCSL_MODEL_VECTOR(earth_flat_t, FCSL_ROLE_FEEDTHROUGH, outputs.position_ned, "m", "from the origin"),
    FCSL_MODEL_SCALAR(earth_flat_t, FCSL_ROLE_PARAMETER, parameters.gravity, "m/s^2", ""),
    FCSL_MODEL_SCALAR(earth_flat_t, FCSL_ROLE_PARAMETER, parameters.latitude, "rad", "of the origin"),
    FCSL_MODEL_SCALAR(earth_flat_t, FCSL_ROLE_PARAMETER, parameters.longitude, "rad", "of the origin"),
    FCSL_MODEL_SCALAR(earth_flat_t, FCSL_ROLE_PARAMETER, parameters.height, "m", "of the origin"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "earth_flat",
    .doc = "a flat Earth that does not turn: constant gravity, position, velocity over ground",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(earth_flat_t),
    .align = _Alignof(earth_flat_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
