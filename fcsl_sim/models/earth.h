/* SPDX-License-Identifier: Apache-2.0
 *
 * What the three Earths share: their ports, and the geometry of an ellipsoid that turns about its axis.
 *
 * Inertial axes are those of the Earth at time 0: z to the north pole, x to the meridian that is given. Earth-fixed axes turn
 * from there by rotation_rate t.
 *
 * Sources: NIMA TR8350.2, Department of Defense World Geodetic System 1984, 3rd ed. (2000), chapters 3 and 4; B. L. Stevens,
 * F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 1.6 (J2 gravity); H. Vermeille,
 * Computing geodetic coordinates from geocentric coordinates, Journal of Geodesy 78 (2004) 94-95 (closed form).
 */
#ifndef FCSL_SIM_MODELS_EARTH_H
#define FCSL_SIM_MODELS_EARTH_H

#include "fcsl/fcsl_model.h"
#include "vectors.h"

typedef struct {
    double position_inertial[3];
    double velocity_inertial[3];
    double attitude_body_to_inertial[4];
    double rate_body[3];
} earth_inputs_t;

typedef struct {
    double gravity_inertial[3];
    double latitude, longitude, height;
    double velocity_ned[3];
    double attitude_body_to_ned[4];
    double rate_over_ground_body[3];
    double gravity;
    double position_ecef[3];
} earth_outputs_t;

#define EARTH_FIELDS(struct_)                                                                                          \
    FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_INPUT, inputs.position_inertial, "m", ""),                                    \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_INPUT, inputs.velocity_inertial, "m/s", ""),                              \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OPTIONAL_INPUT, inputs.attitude_body_to_inertial, "", "w, x, y, z"),      \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_OPTIONAL_INPUT, inputs.rate_body, "rad/s", "in inertial axes"),           \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.gravity_inertial, "m/s^2", "acceleration"),          \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.latitude, "rad", "geodetic"),                        \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.longitude, "rad", ""),                               \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.height, "m", "above the surface"),                   \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.velocity_ned, "m/s", "over ground"),                 \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.attitude_body_to_ned, "", "w, x, y, z"),             \
        FCSL_MODEL_VECTOR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.rate_over_ground_body, "rad/s",                      \
                          "in Earth-fixed axes"),                                                                      \
        FCSL_MODEL_SCALAR(struct_, FCSL_ROLE_FEEDTHROUGH, outputs.gravity, "m/s^2", "the length of that vector")

/* The unit quaternion of an attitude that may be unconnected: none is no turn. */
static inline void earth_attitude(const double *given, double *attitude)
{
    const int is_given = given[0] != 0.0 || given[1] != 0.0 || given[2] != 0.0 || given[3] != 0.0;
    for (int i = 0; i < 4; i++) {
        attitude[i] = is_given ? given[i] : (i == 0 ? 1.0 : 0.0);
    }
}

typedef struct {
    double equatorial_radius; /* m */
    double flattening;
    double rotation_rate; /* rad/s */
} ellipsoid_t;

/* Geodetic latitude and longitude (rad) and height (m) to Earth-centred, Earth-fixed axes (m). */
static inline void ellipsoid_to_ecef(const ellipsoid_t *e, double latitude, double longitude, double height,
                                     double *ecef)
{
    const double squared = e->flattening * (2.0 - e->flattening); /* eccentricity */
    const double sine = cr_sin(latitude), cosine = cr_cos(latitude);
    const double normal = e->equatorial_radius / sqrt(1.0 - squared * sine * sine);
    ecef[0] = (normal + height) * cosine * cr_cos(longitude);
    ecef[1] = (normal + height) * cosine * cr_sin(longitude);
    ecef[2] = (normal * (1.0 - squared) + height) * sine;
}

/* The inverse. It holds outside of the evolute: farther than 43 km from the centre of the Earth. */
static inline void ellipsoid_from_ecef(const ellipsoid_t *e, const double *ecef, double *latitude, double *longitude,
                                       double *height)
{
    const double a = e->equatorial_radius;
    const double squared = e->flattening * (2.0 - e->flattening), fourth = squared * squared;
    const double equatorial = sqrt(ecef[0] * ecef[0] + ecef[1] * ecef[1]);
    const double p = equatorial * equatorial / (a * a);
    const double q = (1.0 - squared) * ecef[2] * ecef[2] / (a * a);
    const double r = (p + q - fourth) / 6.0;
    const double s = fourth * p * q / (4.0 * r * r * r);
    const double t = cr_cbrt(1.0 + s + sqrt(s * (2.0 + s)));
    const double u = r * (1.0 + t + 1.0 / t);
    const double v = sqrt(u * u + fourth * q);
    const double w = squared * (u + v - q) / (2.0 * v);
    const double k = sqrt(u + v + w * w) - w;
    const double d = k * equatorial / (k + squared);
    const double distance = sqrt(d * d + ecef[2] * ecef[2]);
    *height = (k + squared - 1.0) / k * distance;
    *latitude = 2.0 * cr_atan2(ecef[2], d + distance);
    *longitude = cr_atan2(ecef[1], ecef[0]);
}

/* The turn from north, east, down at a place to Earth-fixed axes: longitude about z, then -latitude - 90 degrees about y. */
static inline void ned_to_ecef(double latitude, double longitude, double *q)
{
    const double half_pitch = -0.5 * latitude - 0.78539816339744830962;
    const double cp = cr_cos(half_pitch), sp = cr_sin(half_pitch);
    const double cy = cr_cos(0.5 * longitude), sy = cr_sin(0.5 * longitude);
    q[0] = cp * cy;
    q[1] = -sp * sy;
    q[2] = sp * cy;
    q[3] = cp * sy;
}

/* The turn from Earth-fixed axes at time t (s) to the inertial axes. */
static inline void ecef_to_inertial(const ellipsoid_t *e, double t, double *q)
{
    const double half = 0.5 * e->rotation_rate * t;
    q[0] = cr_cos(half);
    q[1] = 0.0;
    q[2] = 0.0;
    q[3] = cr_sin(half);
}

/* All outputs but gravity. */
static inline void earth_kinematics(const ellipsoid_t *e, double t, const earth_inputs_t *u, earth_outputs_t *y)
{
    double to_inertial[4], to_ned[4], ned_inertial[4], back[4], attitude[4], over_ground[3];
    ecef_to_inertial(e, t, to_inertial);
    quaternion_rotate_back(to_inertial, u->position_inertial, y->position_ecef);
    ellipsoid_from_ecef(e, y->position_ecef, &y->latitude, &y->longitude, &y->height);

    ned_to_ecef(y->latitude, y->longitude, to_ned);
    quaternion_multiply(to_inertial, to_ned, ned_inertial);
    over_ground[0] = u->velocity_inertial[0] + e->rotation_rate * u->position_inertial[1];
    over_ground[1] = u->velocity_inertial[1] - e->rotation_rate * u->position_inertial[0];
    over_ground[2] = u->velocity_inertial[2];
    quaternion_rotate_back(ned_inertial, over_ground, y->velocity_ned);

    earth_attitude(u->attitude_body_to_inertial, attitude);
    quaternion_conjugate(ned_inertial, back);
    quaternion_multiply(back, attitude, y->attitude_body_to_ned);
    const double spin_inertial[3] = {0.0, 0.0, e->rotation_rate};
    double spin_body[3];
    quaternion_rotate_back(attitude, spin_inertial, spin_body);
    for (int i = 0; i < 3; i++) {
        y->rate_over_ground_body[i] = u->rate_body[i] - spin_body[i];
    }
}

/* Gravity of a spheroid: the central term and J2. */
static inline void earth_gravity(double gm, double radius, double j2, const double *r, double *gravity)
{
    const double distance = vector_norm(r);
    const double polar = r[2] / distance;
    const double central = gm / (distance * distance * distance);
    const double oblate = 1.5 * j2 * (radius / distance) * (radius / distance);
    gravity[0] = -central * (1.0 + oblate * (1.0 - 5.0 * polar * polar)) * r[0];
    gravity[1] = -central * (1.0 + oblate * (1.0 - 5.0 * polar * polar)) * r[1];
    gravity[2] = -central * (1.0 + oblate * (3.0 - 5.0 * polar * polar)) * r[2];
}

#endif /* FCSL_SIM_MODELS_EARTH_H */
