/* SPDX-License-Identifier: Apache-2.0
 *
 * Contact of up to 8 points of a rigid body with flat, level ground: springs that only push, with damping and friction.
 *
 * A point at r (body axes) of depth d > 0 below the ground, with velocity v over the ground (v_t along it), gets the
 * force
 *
 *   normal    N = k d max(0, 1 + c d'),   up
 *   friction  -mu N v_t / max(|v_t|, v_s)
 *
 * The normal force is that of Hunt and Crossley with a linear spring: it begins and ends at zero and never pulls. An
 * impact with speed v loses about 2 c v / 3 of it. Friction is Coulomb's above the speed v_s; below, it falls linearly
 * to zero, so that what should stick creeps, slower than v_s.
 *
 * Sources: K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in vibroimpact, J. of
 * Applied Mechanics 42 (1975) 440-445; F. Marques, P. Flores, J. C. Pimenta Claro, H. M. Lankarani, A survey and
 * comparison of several friction force models for dynamic analysis of multibody mechanical systems, Nonlinear Dynamics
 * 86 (2016) 1407-1443, section 2.
 *
 * Limits: points only, no wheels (friction is the same in all directions), no terrain, no stiction.
 */
#include <stdbool.h>

#include "fcsl/fcsl_model.h"
#include "vectors.h"

enum { POINTS = 8 };

typedef struct {
    struct {
        double height;
        double attitude_body_to_ned[4];
        double velocity_ned[3];
        double rate_body[3];
    } inputs;
    struct {
        uint32_t points;
        double x[POINTS], y[POINTS], z[POINTS];
        double stiffness;
        double damping;
        double friction;
        double friction_speed;
    } parameters;
    struct {
        double force_body[3];
        double torque_body[3];
        bool touching;
        double normal_force;
    } outputs;
} ground_contact_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const ground_contact_t *contact = self;
    (void)context;
    if (!(contact->parameters.points >= 1 && contact->parameters.points <= POINTS)) {
        return "parameters.points must be 1 to 8";
    }
    if (!(contact->parameters.stiffness > 0.0)) {
        return "parameters.stiffness must be positive";
    }
    if (!(contact->parameters.damping >= 0.0)) {
        return "parameters.damping must not be negative";
    }
    if (!(contact->parameters.friction >= 0.0)) {
        return "parameters.friction must not be negative";
    }
    if (!(contact->parameters.friction_speed > 0.0)) {
        return "parameters.friction_speed must be positive";
    }
    return NULL;
}

/* The force on one point of the body; false if it does not touch. `arm` is its position in body axes. */
static bool point_force(const ground_contact_t *contact, const double *arm, double *force_ned)
{
    double arm_ned[3], turning[3], turning_ned[3];
    quaternion_rotate(contact->inputs.attitude_body_to_ned, arm, arm_ned);
    const double depth = arm_ned[2] - contact->inputs.height;
    if (!(depth > 0.0)) {
        return false;
    }
    vector_cross(contact->inputs.rate_body, arm, turning);
    quaternion_rotate(contact->inputs.attitude_body_to_ned, turning, turning_ned);
    const double north = contact->inputs.velocity_ned[0] + turning_ned[0];
    const double east = contact->inputs.velocity_ned[1] + turning_ned[1];
    const double depth_rate = contact->inputs.velocity_ned[2] + turning_ned[2];
    const double damped = fmax(0.0, 1.0 + contact->parameters.damping * depth_rate);
    const double normal = contact->parameters.stiffness * depth * damped;
    const double speed = fmax(sqrt(north * north + east * east), contact->parameters.friction_speed);
    force_ned[0] = -contact->parameters.friction * normal * north / speed;
    force_ned[1] = -contact->parameters.friction * normal * east / speed;
    force_ned[2] = -normal;
    return true;
}

static void output(void *self, double t, const double *x)
{
    ground_contact_t *contact = self;
    (void)t, (void)x;
    double force[3] = {0.0, 0.0, 0.0}, torque[3] = {0.0, 0.0, 0.0};
    bool touching = false;
    double normal_force = 0.0;
    for (uint32_t i = 0; i < POINTS && i < contact->parameters.points; i++) {
        const double arm[3] = {contact->parameters.x[i], contact->parameters.y[i], contact->parameters.z[i]};
        double force_ned[3], force_body[3], torque_body[3];
        if (!point_force(contact, arm, force_ned)) {
            continue;
        }
        touching = true;
        normal_force -= force_ned[2];
        quaternion_rotate_back(contact->inputs.attitude_body_to_ned, force_ned, force_body);
        vector_cross(arm, force_body, torque_body);
        for (int k = 0; k < 3; k++) {
            force[k] += force_body[k];
            torque[k] += torque_body[k];
        }
    }
    for (int k = 0; k < 3; k++) {
        contact->outputs.force_body[k] = force[k];
        contact->outputs.torque_body[k] = torque[k];
    }
    contact->outputs.touching = touching;
    contact->outputs.normal_force = normal_force;
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_INPUT, inputs.height, "m", "of the centre of mass above the ground"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "w, x, y, z"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_INPUT, inputs.velocity_ned, "m/s",
                      "of the centre of mass, over ground"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_INPUT, inputs.rate_body, "rad/s", "over ground"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.points, "", "how many of the 8 there are"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.x, "m",
                      "of the points, from the centre of mass"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.y, "m", "to the right"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.z, "m", "down"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.stiffness, "N/m", "of one point"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.damping, "s/m",
                      "an impact at v loses 2/3 damping v of v"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.friction, "",
                      "coefficient of Coulomb friction"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_PARAMETER, parameters.friction_speed, "m/s",
                      "full friction from here on"),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_FEEDTHROUGH, outputs.force_body, "N", ""),
    FCSL_MODEL_VECTOR(ground_contact_t, FCSL_ROLE_FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_FEEDTHROUGH, outputs.touching, "", "a point is below the ground"),
    FCSL_MODEL_SCALAR(ground_contact_t, FCSL_ROLE_FEEDTHROUGH, outputs.normal_force, "N", "of all points"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "ground_contact",
    .doc = "contact of points of a rigid body with flat ground: springs that only push, friction",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(ground_contact_t),
    .align = _Alignof(ground_contact_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
