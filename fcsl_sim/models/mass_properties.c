/* SPDX-License-Identifier: Apache-2.0
 *
 * Mass and inertia of a vehicle that burns propellant.
 *
 *   m = dry_mass + p,   I = dry_inertia + s propellant_inertia
 *   I' = -mass_flow / full_propellant_mass propellant_inertia
 *
 * p is the mass of the propellant and s = p / full_propellant_mass. Inertias are about the centre of mass of the
 * vehicle, in body axes, with products of inertia as negative integrals of x y and so on.
 *
 * An inertia is possible if the second moments of the mass, tr(I)/2 - I, are those of no negative mass: a matrix
 * without negative eigenvalues. This is the triangle inequality of the principal moments.
 *
 * Source: P. M. Wensing, S. Kim, J.-J. E. Slotine, Linear matrix inequalities for physically consistent inertial
 * parameter identification, IEEE Robotics and Automation Letters 3 (2018) 60-67.
 *
 * Limits: the centre of mass stays where it is; the tank empties as if the propellant became thinner everywhere.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"

/* What rounding of the given numbers may miss, as a part of the trace: a thin plate is possible. */
static const double TOLERANCE = 1e-9;

typedef struct {
    struct {
        double propellant_mass, mass_flow;
    } inputs;
    struct {
        double dry_mass;
        double dry_inertia[3][3];
        double full_propellant_mass;
        double propellant_inertia[3][3];
    } parameters;
    struct {
        double mass;
        double inertia[3][3];
        double inertia_rate[3][3];
    } outputs;
} mass_properties_t;

static bool is_symmetric(const double (*m)[3])
{
    return m[0][1] == m[1][0] && m[0][2] == m[2][0] && m[1][2] == m[2][1];
}

/* Whether a symmetric matrix has no eigenvalue below `least`: no principal minor of m - least is negative. */
static bool eigenvalues_are_at_least(const double (*m)[3], double least)
{
    const double a = m[0][0] - least, b = m[1][1] - least, c = m[2][2] - least;
    const double minor_01 = a * b - m[0][1] * m[0][1];
    const double minor_02 = a * c - m[0][2] * m[0][2];
    const double minor_12 = b * c - m[1][2] * m[1][2];
    const double whole =
        a * minor_12 - m[0][1] * (m[0][1] * c - m[0][2] * m[1][2]) + m[0][2] * (m[0][1] * m[1][2] - b * m[0][2]);
    return a >= 0.0 && b >= 0.0 && c >= 0.0 && minor_01 >= 0.0 && minor_02 >= 0.0 && minor_12 >= 0.0 && whole >= 0.0;
}

static double trace(const double (*m)[3])
{
    return m[0][0] + m[1][1] + m[2][2];
}

/* The triangle inequality of the principal moments; no moment is negative then. */
static bool is_possible(const double (*inertia)[3])
{
    double second_moments[3][3];
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            second_moments[i][k] = (i == k ? 0.5 * trace(inertia) : 0.0) - inertia[i][k];
        }
    }
    return eigenvalues_are_at_least((const double (*)[3])second_moments, -TOLERANCE * trace(inertia));
}

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const mass_properties_t *vehicle = self;
    (void)context;
    const double (*dry)[3] = vehicle->parameters.dry_inertia;
    const double (*propellant)[3] = vehicle->parameters.propellant_inertia;
    if (!(vehicle->parameters.dry_mass > 0.0)) {
        return "parameters.dry_mass must be positive";
    }
    if (!(vehicle->parameters.full_propellant_mass >= 0.0)) {
        return "parameters.full_propellant_mass must not be negative";
    }
    if (!is_symmetric(dry)) {
        return "parameters.dry_inertia must be symmetric";
    }
    if (!(trace(dry) > 0.0 && eigenvalues_are_at_least(dry, TOLERANCE * trace(dry)))) {
        return "parameters.dry_inertia must be positive definite";
    }
    if (!is_possible(dry)) {
        return "parameters.dry_inertia is that of no body: a principal moment exceeds the sum of the others";
    }
    if (!is_symmetric(propellant)) {
        return "parameters.propellant_inertia must be symmetric";
    }
    if (!is_possible(propellant)) {
        return "parameters.propellant_inertia is that of no body: a principal moment exceeds the sum of the others";
    }
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    mass_properties_t *vehicle = self;
    (void)t, (void)x;
    const double full = vehicle->parameters.full_propellant_mass;
    const double share = full > 0.0 ? vehicle->inputs.propellant_mass / full : 0.0;
    const double share_rate = full > 0.0 ? -vehicle->inputs.mass_flow / full : 0.0;
    vehicle->outputs.mass = vehicle->parameters.dry_mass + vehicle->inputs.propellant_mass;
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            const double propellant = vehicle->parameters.propellant_inertia[i][k];
            vehicle->outputs.inertia[i][k] = vehicle->parameters.dry_inertia[i][k] + share * propellant;
            vehicle->outputs.inertia_rate[i][k] = share_rate * propellant;
        }
    }
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(mass_properties_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.propellant_mass, "kg", "what is left"),
    FCSL_MODEL_SCALAR(mass_properties_t, FCSL_ROLE_OPTIONAL_INPUT, inputs.mass_flow, "kg/s", "positive when it leaves"),
    FCSL_MODEL_SCALAR(mass_properties_t, FCSL_ROLE_PARAMETER, parameters.dry_mass, "kg", ""),
    FCSL_MODEL_MATRIX(mass_properties_t, FCSL_ROLE_PARAMETER, parameters.dry_inertia, "kg*m^2", ""),
    FCSL_MODEL_SCALAR(mass_properties_t, FCSL_ROLE_PARAMETER, parameters.full_propellant_mass, "kg", "0: none"),
    FCSL_MODEL_MATRIX(mass_properties_t, FCSL_ROLE_PARAMETER, parameters.propellant_inertia, "kg*m^2",
                      "of the full propellant, about the centre of mass of the vehicle"),
    FCSL_MODEL_SCALAR(mass_properties_t, FCSL_ROLE_FEEDTHROUGH, outputs.mass, "kg", ""),
    FCSL_MODEL_MATRIX(mass_properties_t, FCSL_ROLE_FEEDTHROUGH, outputs.inertia, "kg*m^2",
                      "about the centre of mass, body axes"),
    FCSL_MODEL_MATRIX(mass_properties_t, FCSL_ROLE_FEEDTHROUGH, outputs.inertia_rate, "kg*m^2/s", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "mass_properties",
    .doc = "mass and inertia of a vehicle that burns propellant",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(mass_properties_t),
    .align = _Alignof(mass_properties_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
