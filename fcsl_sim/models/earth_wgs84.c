/* SPDX-License-Identifier: Apache-2.0
 *
 * The Earth as the WGS-84 ellipsoid, which turns, with J2 gravity (earth.h).
 *
 * Heights are above the ellipsoid. The constants are those of WGS-84; J2 follows from its second-degree zonal coefficient.
 * Left out: higher terms of gravity, precession, nutation and polar motion, sun and moon.
 */
#include "earth.h"

static const ellipsoid_t WGS84 = {6378137.0, 1.0 / 298.257223563, 7.292115e-5};
static const double GM = 3.986004418e14;   /* m^3/s^2 */
static const double J2 = 1.08262982131e-3; /* -sqrt(5) times -0.484166774985e-3 */

typedef struct {
    earth_inputs_t inputs;
    earth_outputs_t outputs;
} earth_wgs84_t;

static void output(void *self, double t, const double *x)
{
    earth_wgs84_t *earth = self;
    (void)x;
    earth_kinematics(&WGS84, t, &earth->inputs, &earth->outputs);
    earth_gravity(GM, WGS84.equatorial_radius, J2, earth->inputs.position_inertial, earth->outputs.gravity_inertial);
    earth->outputs.gravity = vector_norm(earth->outputs.gravity_inertial);
}

static const fcsl_field_t fields[] = {
    EARTH_FIELDS(earth_wgs84_t),
    FCSL_MODEL_VECTOR(earth_wgs84_t, FCSL_ROLE_FEEDTHROUGH, outputs.position_ecef, "m", "Earth-centred, Earth-fixed"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "earth_wgs84",
    .doc = "the WGS-84 Earth, which turns: J2 gravity, geodetic position, velocity over ground",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(earth_wgs84_t),
    .align = _Alignof(earth_wgs84_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
