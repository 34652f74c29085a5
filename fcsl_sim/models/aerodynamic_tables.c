/* SPDX-License-Identifier: Apache-2.0
 *
 * The aerodynamic force and torque of a fixed-wing aircraft: lift, drag and pitching moment from tables over the angle
 * of attack a, the rest linear in sideslip b, rates (p, q, r) and controls. Dynamic pressure Q, airspeed V:
 *
 * CL = lift(a) + CL_q q chord / (2 V) + CL_elevator elevator,  CD = drag(a)
 * CY = CY_b b + CY_rudder rudder
 * Cl = Cl_b b + (Cl_p p + Cl_r r) span / (2 V) + Cl_aileron aileron + Cl_rudder rudder
 * Cm = pitching_moment(a) + Cm_q q chord / (2 V) + Cm_elevator elevator
 * Cn = Cn_b b + (Cn_p p + Cn_r r) span / (2 V) + Cn_aileron aileron + Cn_rudder rudder
 * force = Q area (CL sin a - CD cos a, CY, -CL cos a - CD sin a)
 * torque = Q area (span Cl, chord Cm, span Cn) + moment_reference x force
 *
 * Tables are linear between their rows, and their ends hold. Q / (2 V) is taken as 0 at zero airspeed, its limit.
 *
 * Source: B. L. Stevens, F. L. Lewis, E. N. Johnson, Aircraft Control and Simulation, 3rd ed. (2016), section 2.3, with
 * lift and drag in stability axes and the side force along the y axis of the body. Limits: sideslip and rates are
 * small; drag depends neither on them nor on controls; no effect of Mach number, ground or unsteady flow.
 */
#include "fcsl/fcsl_model.h"
#include "linear_table.h"
#include "vectors.h"

enum { CAPACITY = 64 };

typedef struct {
    struct {
        double airspeed, angle_of_attack, sideslip, dynamic_pressure;
        double rate_body[3];
        double gust_rate_body[3];
        double elevator, aileron, rudder;
    } inputs;
    struct {
        double angle_of_attack[CAPACITY];
        double lift[CAPACITY];
        double drag[CAPACITY];
        double pitching_moment[CAPACITY];
        double lift_from_pitch_rate, lift_from_elevator;
        double side_force_from_sideslip, side_force_from_rudder;
        double roll_from_sideslip, roll_from_roll_rate, roll_from_yaw_rate, roll_from_aileron, roll_from_rudder;
        double pitch_from_pitch_rate, pitch_from_elevator;
        double yaw_from_sideslip, yaw_from_roll_rate, yaw_from_yaw_rate, yaw_from_aileron, yaw_from_rudder;
        double area, span, chord;
        double moment_reference_body[3];
    } parameters;
    struct {
        double force_body[3];
        double torque_body[3];
        double lift_coefficient, drag_coefficient;
    } outputs;
} aerodynamic_tables_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const aerodynamic_tables_t *craft = self;
    (void)context;
    if (!table_increases(craft->parameters.angle_of_attack, CAPACITY)) {
        return "parameters.angle_of_attack must increase from row to row";
    }
    if (!(craft->parameters.area > 0.0)) {
        return "parameters.area must be positive";
    }
    if (!(craft->parameters.span > 0.0)) {
        return "parameters.span must be positive";
    }
    if (!(craft->parameters.chord > 0.0)) {
        return "parameters.chord must be positive";
    }
    return NULL;
}

static void output(void *self, double t, const double *x)
{
    aerodynamic_tables_t *craft = self;
    (void)t, (void)x;
    const double angle = craft->inputs.angle_of_attack, sideslip = craft->inputs.sideslip;
    const double elevator = craft->inputs.elevator, aileron = craft->inputs.aileron, rudder = craft->inputs.rudder;
    const double span = craft->parameters.span, chord = craft->parameters.chord;
    double rate[3];
    for (int i = 0; i < 3; i++) {
        rate[i] = craft->inputs.rate_body[i] - craft->inputs.gust_rate_body[i];
    }
    const table_place_t place = table_find(craft->parameters.angle_of_attack, CAPACITY, angle);
    const double lift = table_value(craft->parameters.lift, place) + craft->parameters.lift_from_elevator * elevator;
    const double drag = table_value(craft->parameters.drag, place);

    /* Products with Q area, and those of rates with Q area / (2 V), so that no rate is divided by a small airspeed. */
    const double force = craft->inputs.dynamic_pressure * craft->parameters.area;
    const double damping = craft->inputs.airspeed > 0.0 ? 0.5 * force / craft->inputs.airspeed : 0.0;
    const double lift_force = force * lift + damping * chord * craft->parameters.lift_from_pitch_rate * rate[1];
    const double drag_force = force * drag;
    const double side_force = force * (craft->parameters.side_force_from_sideslip * sideslip +
                                       craft->parameters.side_force_from_rudder * rudder);
    const double roll =
        force * (craft->parameters.roll_from_sideslip * sideslip + craft->parameters.roll_from_aileron * aileron +
                 craft->parameters.roll_from_rudder * rudder) +
        damping * span *
            (craft->parameters.roll_from_roll_rate * rate[0] + craft->parameters.roll_from_yaw_rate * rate[2]);
    const double pitch = force * (table_value(craft->parameters.pitching_moment, place) +
                                  craft->parameters.pitch_from_elevator * elevator) +
                         damping * chord * craft->parameters.pitch_from_pitch_rate * rate[1];
    const double yaw =
        force * (craft->parameters.yaw_from_sideslip * sideslip + craft->parameters.yaw_from_aileron * aileron +
                 craft->parameters.yaw_from_rudder * rudder) +
        damping * span *
            (craft->parameters.yaw_from_roll_rate * rate[0] + craft->parameters.yaw_from_yaw_rate * rate[2]);

    const double sine = cr_sin(angle), cosine = cr_cos(angle);
    double *force_body = craft->outputs.force_body;
    force_body[0] = lift_force * sine - drag_force * cosine;
    force_body[1] = side_force;
    force_body[2] = -lift_force * cosine - drag_force * sine;
    double arm[3];
    vector_cross(craft->parameters.moment_reference_body, force_body, arm);
    craft->outputs.torque_body[0] = span * roll + arm[0];
    craft->outputs.torque_body[1] = chord * pitch + arm[1];
    craft->outputs.torque_body[2] = span * yaw + arm[2];
    craft->outputs.lift_coefficient = lift;
    craft->outputs.drag_coefficient = drag;
}

#define SCALAR(role, path, unit, doc) FCSL_MODEL_SCALAR(aerodynamic_tables_t, FCSL_ROLE_##role, path, unit, doc)
#define VECTOR(role, path, unit, doc) FCSL_MODEL_VECTOR(aerodynamic_tables_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.airspeed, "m/s", ""),
    SCALAR(INPUT, inputs.angle_of_attack, "rad", ""),
    SCALAR(INPUT, inputs.sideslip, "rad", ""),
    SCALAR(INPUT, inputs.dynamic_pressure, "Pa", ""),
    VECTOR(INPUT, inputs.rate_body, "rad/s", "of the body over ground"),
    VECTOR(OPTIONAL_INPUT, inputs.gust_rate_body, "rad/s", "of the air"),
    SCALAR(OPTIONAL_INPUT, inputs.elevator, "rad", ""),
    SCALAR(OPTIONAL_INPUT, inputs.aileron, "rad", ""),
    SCALAR(OPTIONAL_INPUT, inputs.rudder, "rad", ""),
    VECTOR(TABLE, parameters.angle_of_attack, "rad", "increasing"),
    VECTOR(TABLE, parameters.lift, "", "CL at each angle"),
    VECTOR(TABLE, parameters.drag, "", "CD at each angle"),
    VECTOR(TABLE, parameters.pitching_moment, "", "Cm at each angle"),
    SCALAR(PARAMETER, parameters.lift_from_pitch_rate, "", "CL by q chord / (2 V)"),
    SCALAR(PARAMETER, parameters.lift_from_elevator, "1/rad", ""),
    SCALAR(PARAMETER, parameters.side_force_from_sideslip, "1/rad", "negative: against the sideslip"),
    SCALAR(PARAMETER, parameters.side_force_from_rudder, "1/rad", ""),
    SCALAR(PARAMETER, parameters.roll_from_sideslip, "1/rad", "negative: stable"),
    SCALAR(PARAMETER, parameters.roll_from_roll_rate, "", "Cl by p span / (2 V); negative: it damps"),
    SCALAR(PARAMETER, parameters.roll_from_yaw_rate, "", "Cl by r span / (2 V)"),
    SCALAR(PARAMETER, parameters.roll_from_aileron, "1/rad", ""),
    SCALAR(PARAMETER, parameters.roll_from_rudder, "1/rad", ""),
    SCALAR(PARAMETER, parameters.pitch_from_pitch_rate, "", "Cm by q chord / (2 V); negative: it damps"),
    SCALAR(PARAMETER, parameters.pitch_from_elevator, "1/rad", ""),
    SCALAR(PARAMETER, parameters.yaw_from_sideslip, "1/rad", "positive: stable"),
    SCALAR(PARAMETER, parameters.yaw_from_roll_rate, "", "Cn by p span / (2 V)"),
    SCALAR(PARAMETER, parameters.yaw_from_yaw_rate, "", "Cn by r span / (2 V); negative: it damps"),
    SCALAR(PARAMETER, parameters.yaw_from_aileron, "1/rad", ""),
    SCALAR(PARAMETER, parameters.yaw_from_rudder, "1/rad", ""),
    SCALAR(PARAMETER, parameters.area, "m^2", "of the wing"),
    SCALAR(PARAMETER, parameters.span, "m", "reference length of roll and yaw"),
    SCALAR(PARAMETER, parameters.chord, "m", "reference length of pitch"),
    VECTOR(PARAMETER, parameters.moment_reference_body, "m", "where the forces act, from the centre of mass"),
    VECTOR(FEEDTHROUGH, outputs.force_body, "N", ""),
    VECTOR(FEEDTHROUGH, outputs.torque_body, "N*m", "about the centre of mass"),
    SCALAR(FEEDTHROUGH, outputs.lift_coefficient, "", "of table and elevator, without the pitch rate"),
    SCALAR(FEEDTHROUGH, outputs.drag_coefficient, "", ""),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "aerodynamic_tables",
    .doc = "force and torque of a fixed-wing aircraft, from tables over the angle of attack",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(aerodynamic_tables_t),
    .align = _Alignof(aerodynamic_tables_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
