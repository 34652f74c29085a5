/* SPDX-License-Identifier: Apache-2.0
 *
 * The motion of a body through the air: airspeed, angles, dynamic pressure and Mach number from the velocities of both.
 *
 * (u, v, w) = R^T (velocity - wind) - gust,  V = |(u, v, w)|,  angle of attack = atan2(w, u),  sideslip = asin(v / V)
 * dynamic pressure = density V^2 / 2,  Mach = V / speed of sound
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 2.3. At
 * zero airspeed the angles and the Mach number are 0.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    struct {
        double velocity_ned[3];
        double wind_ned[3];
        double gust_body[3];
        double attitude_body_to_ned[4];
        double density, speed_of_sound;
    } inputs;
    struct {
        double velocity_air_body[3];
        double airspeed, angle_of_attack, sideslip, dynamic_pressure, mach;
    } outputs;
} air_data_t;

static void output(void *self, double t, const double *x)
{
    air_data_t *air = self;
    (void)t, (void)x;
    double steady_ned[3], steady_body[3];
    for (int i = 0; i < 3; i++) {
        steady_ned[i] = air->inputs.velocity_ned[i] - air->inputs.wind_ned[i];
    }
    quaternion_rotate_back(air->inputs.attitude_body_to_ned, steady_ned, steady_body);
    double *velocity = air->outputs.velocity_air_body;
    for (int i = 0; i < 3; i++) {
        velocity[i] = steady_body[i] - air->inputs.gust_body[i];
    }
    const double airspeed = vector_norm(velocity);
    const bool stands = airspeed == 0.0;
    /* asin(v / V), which loses digits near 90 degrees, as an arc tangent */
    const double in_plane = sqrt(velocity[0] * velocity[0] + velocity[2] * velocity[2]);
    air->outputs.airspeed = airspeed;
    air->outputs.angle_of_attack = stands ? 0.0 : cr_atan2(velocity[2], velocity[0]);
    air->outputs.sideslip = stands ? 0.0 : cr_atan2(velocity[1], in_plane);
    air->outputs.dynamic_pressure = 0.5 * air->inputs.density * airspeed * airspeed;
    air->outputs.mach = stands ? 0.0 : airspeed / air->inputs.speed_of_sound;
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(air_data_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(air_data_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    VECTOR(INPUT, inputs.velocity_ned, "m/s", "of the body over ground"),
    VECTOR(OPTIONAL_INPUT, inputs.wind_ned, "m/s", "of the air over ground"),
    VECTOR(OPTIONAL_INPUT, inputs.gust_body, "m/s", "of the air in the wind"),
    VECTOR(INPUT, inputs.attitude_body_to_ned, "", "unit quaternion, w, x, y, z"),
    SCALAR(INPUT, inputs.density, "kg/m^3", ""),
    SCALAR(INPUT, inputs.speed_of_sound, "m/s", ""),
    VECTOR(FEEDTHROUGH, outputs.velocity_air_body, "m/s", "of the body through the air"),
    SCALAR(FEEDTHROUGH, outputs.airspeed, "m/s", "true airspeed"),
    SCALAR(FEEDTHROUGH, outputs.angle_of_attack, "rad", "positive: air comes from below"),
    SCALAR(FEEDTHROUGH, outputs.sideslip, "rad", "positive: air comes from the right"),
    SCALAR(FEEDTHROUGH, outputs.dynamic_pressure, "Pa", ""),
    SCALAR(FEEDTHROUGH, outputs.mach, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "air_data",
    .doc = "airspeed, angle of attack, sideslip, dynamic pressure and Mach number of a body",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(air_data_t),
    .align = _Alignof(air_data_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
