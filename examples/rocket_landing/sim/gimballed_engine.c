/* SPDX-License-Identifier: Apache-2.0
 *
 * What two servos and a tank that runs down make of the thrust of `rocket_engine`: its direction, its lever arm, and the
 * angular momentum that the jet takes along.
 *
 *   force  = T (cos a sin b, -sin a, -cos a cos b)                 T: thrust, a and b: angles about x and y
 *   c      = ((mass - p) dry_offset + p (0, 0, tank)) / mass           p: propellant left
 *   l      = (0, 0, pivot) - c
 *   torque = l x force - mass_flow l x (w x l)
 *
 * All places are from the centre of mass of the nominal dry vehicle; c is the centre of mass. A positive
 * angle makes a positive torque. The second term of the torque is jet damping: `mass_properties` and
 * `rigid_body` have the change of the inertia alone.
 *
 * Source of the jet damping: W. T. Thomson, Introduction to Space Dynamics (1961).
 *
 * Limits: no inertia of the nozzle, no sloshing. The shift of c moves no other part: legs and sensors stay at their
 * places from the moving centre of mass.
 */
#include "fcsl/fcsl_math.h"
#include "fcsl/fcsl_model.h"

typedef struct {
    struct {
        double thrust;
        double angle_x, angle_y;
        double mass, propellant_mass, mass_flow;
        double rate_body[3];
    } inputs;
    struct {
        double pivot;
        double tank;
        double dry_offset_body[3];
    } parameters;
    struct {
        double force_body[3];
        double torque_body[3];
        double centre_of_mass_body[3];
    } outputs;
} gimballed_engine_t;

static void cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

static void output(void *self, double t, const double *x)
{
    gimballed_engine_t *engine = self;
    (void)t, (void)x;
    const double thrust = engine->inputs.thrust, propellant = engine->inputs.propellant_mass;
    const double sin_x = cr_sin(engine->inputs.angle_x), cos_x = cr_cos(engine->inputs.angle_x);
    const double sin_y = cr_sin(engine->inputs.angle_y), cos_y = cr_cos(engine->inputs.angle_y);
    const double force[3] = {thrust * cos_x * sin_y, -thrust * sin_x, -thrust * cos_x * cos_y};
    const double mass = engine->inputs.mass, dry_mass = mass - propellant;
    double arm[3], moment[3], jet_velocity[3], jet[3];
    for (int i = 0; i < 3; i++) {
        const double full = i == 2 ? engine->parameters.tank : 0.0;
        const double centre = (dry_mass * engine->parameters.dry_offset_body[i] + propellant * full) / mass;
        engine->outputs.centre_of_mass_body[i] = centre;
        arm[i] = (i == 2 ? engine->parameters.pivot : 0.0) - centre;
    }
    cross(arm, force, moment);
    cross(engine->inputs.rate_body, arm, jet_velocity);
    cross(arm, jet_velocity, jet);
    for (int i = 0; i < 3; i++) {
        engine->outputs.force_body[i] = force[i];
        engine->outputs.torque_body[i] = moment[i] - engine->inputs.mass_flow * jet[i];
    }
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(gimballed_engine_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(gimballed_engine_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.thrust, "N", ""),
    SCALAR(INPUT, inputs.angle_x, "rad", "of the nozzle; positive: torque about x"),
    SCALAR(INPUT, inputs.angle_y, "rad", "positive: torque about y"),
    SCALAR(INPUT, inputs.mass, "kg", "of the vehicle with its propellant"),
    SCALAR(INPUT, inputs.propellant_mass, "kg", "what is left"),
    SCALAR(INPUT, inputs.mass_flow, "kg/s", "positive when it leaves"),
    VECTOR(INPUT, inputs.rate_body, "rad/s", ""),
    SCALAR(PARAMETER, parameters.pivot, "m", "of the nozzle, below the nominal dry centre of mass"),
    SCALAR(PARAMETER, parameters.tank, "m", "centre of the propellant, likewise; negative: above"),
    VECTOR(PARAMETER, parameters.dry_offset_body, "m", "of the dry centre of mass from where it should be"),
    VECTOR(FEEDTHROUGH, outputs.force_body, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    VECTOR(FEEDTHROUGH, outputs.centre_of_mass_body, "m", "from that of the nominal dry vehicle"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "gimballed_engine",
    .doc = "direction, lever arm and jet damping of an engine on a gimbal, with a centre of mass that moves",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(gimballed_engine_t),
    .align = _Alignof(gimballed_engine_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
