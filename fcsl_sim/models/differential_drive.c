/* SPDX-License-Identifier: Apache-2.0
 *
 * A vehicle on two driven wheels: motors that follow commands of speed, and the motion of its chassis on flat ground.
 *
 *   time_constant w_i' = clamp(command_i, -max_wheel_speed, max_wheel_speed) - w_i,   i: left, right
 *   v_i = (1 - slip_i) radius_i w_i
 *   v = (v_left + v_right) / 2,   yaw_rate = (v_right - v_left) / wheel_separation
 *   x' = v cos(heading),  y' = v sin(heading),  heading' = yaw_rate
 *
 * Axes are those of ROS (REP-103): x forward, y left, heading counterclockwise from x; the point is the middle of the
 * axle. Angles of the wheels grow forward, as their encoders count.
 *
 * Source: R. Siegwart, I. R. Nourbakhsh, D. Scaramuzza, Introduction to Autonomous Mobile Robots, 2nd ed. (2011),
 * section 3.2.
 *
 * Limits: no mass, no lateral slip; slip is a part of the wheel's way, not what friction leaves.
 */
#include "clamp.h"
#include "fcsl/fcsl_model.h"

enum { LEFT, RIGHT, WHEELS };

typedef struct {
    struct {
        double command_left;
        double command_right;
        double slip_left;
        double slip_right;
    } inputs;
    struct {
        double wheel_separation;
        double radius_left;
        double radius_right;
        double max_wheel_speed;
        double time_constant;
        double x;
        double y;
        double heading;
    } parameters;
    struct {
        double x, y, heading; /* integrated, as all here */
        double speed[WHEELS];
        double angle[WHEELS];
    } state;
    struct {
        double x;
        double y;
        double heading;
        double forward_speed;
        double yaw_rate;
        double speed_left;
        double speed_right;
        double angle_left;
        double angle_right;
    } outputs;
} differential_drive_t;

enum { X, Y, HEADING, SPEED, ANGLE = SPEED + WHEELS, STATES = ANGLE + WHEELS };

static const char *init(void *self, const fcsl_model_context_t *context)
{
    differential_drive_t *rover = self;
    (void)context;
    if (!(rover->parameters.wheel_separation > 0.0)) {
        return "parameters.wheel_separation must be positive";
    }
    if (!(rover->parameters.radius_left > 0.0)) {
        return "parameters.radius_left must be positive";
    }
    if (!(rover->parameters.radius_right > 0.0)) {
        return "parameters.radius_right must be positive";
    }
    if (!(rover->parameters.max_wheel_speed >= 0.0)) {
        return "parameters.max_wheel_speed must not be negative";
    }
    if (!(rover->parameters.time_constant > 0.0)) {
        return "parameters.time_constant must be positive";
    }
    rover->state.x = rover->parameters.x;
    rover->state.y = rover->parameters.y;
    rover->state.heading = rover->parameters.heading;
    return NULL;
}

static double way_of(double slip, double radius, double speed)
{
    return (1.0 - slip) * radius * speed;
}

static void motion_of(const differential_drive_t *rover, const double *x, double *forward, double *yaw_rate)
{
    const double left = way_of(rover->inputs.slip_left, rover->parameters.radius_left, x[SPEED + LEFT]);
    const double right = way_of(rover->inputs.slip_right, rover->parameters.radius_right, x[SPEED + RIGHT]);
    *forward = 0.5 * (left + right);
    *yaw_rate = (right - left) / rover->parameters.wheel_separation;
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const differential_drive_t *rover = self;
    const double limit = rover->parameters.max_wheel_speed;
    const double left = clamp(rover->inputs.command_left, -limit, limit);
    const double right = clamp(rover->inputs.command_right, -limit, limit);
    double forward, yaw_rate;
    (void)t;
    motion_of(rover, x, &forward, &yaw_rate);
    dx[X] = forward * cr_cos(x[HEADING]);
    dx[Y] = forward * cr_sin(x[HEADING]);
    dx[HEADING] = yaw_rate;
    dx[SPEED + LEFT] = (left - x[SPEED + LEFT]) / rover->parameters.time_constant;
    dx[SPEED + RIGHT] = (right - x[SPEED + RIGHT]) / rover->parameters.time_constant;
    dx[ANGLE + LEFT] = x[SPEED + LEFT];
    dx[ANGLE + RIGHT] = x[SPEED + RIGHT];
}

static void output(void *self, double t, const double *x)
{
    differential_drive_t *rover = self;
    (void)t;
    rover->outputs.x = x[X];
    rover->outputs.y = x[Y];
    rover->outputs.heading = x[HEADING];
    motion_of(rover, x, &rover->outputs.forward_speed, &rover->outputs.yaw_rate);
    rover->outputs.speed_left = x[SPEED + LEFT];
    rover->outputs.speed_right = x[SPEED + RIGHT];
    rover->outputs.angle_left = x[ANGLE + LEFT];
    rover->outputs.angle_right = x[ANGLE + RIGHT];
}

#define SCALAR(role_, path_, unit_, doc_) FCSL_MODEL_SCALAR(differential_drive_t, FCSL_ROLE_##role_, path_, unit_, doc_)
#define VECTOR(role_, path_, unit_, doc_) FCSL_MODEL_VECTOR(differential_drive_t, FCSL_ROLE_##role_, path_, unit_, doc_)

static const fcsl_field_t fields[] = {
    SCALAR(INPUT, inputs.command_left, "rad/s", "speed of the left wheel"),
    SCALAR(INPUT, inputs.command_right, "rad/s", "speed of the right wheel"),
    SCALAR(OPTIONAL_INPUT, inputs.slip_left, "", "part of the wheel's way that is lost"),
    SCALAR(OPTIONAL_INPUT, inputs.slip_right, "", "part of the wheel's way that is lost"),
    SCALAR(PARAMETER, parameters.wheel_separation, "m", "between the middles of the wheels"),
    SCALAR(PARAMETER, parameters.radius_left, "m", ""),
    SCALAR(PARAMETER, parameters.radius_right, "m", ""),
    SCALAR(PARAMETER, parameters.max_wheel_speed, "rad/s", ""),
    SCALAR(PARAMETER, parameters.time_constant, "s", "of a motor with its wheel"),
    SCALAR(OPTIONAL_PARAMETER, parameters.x, "m", "at the start"),
    SCALAR(OPTIONAL_PARAMETER, parameters.y, "m", "at the start"),
    SCALAR(OPTIONAL_PARAMETER, parameters.heading, "rad", "at the start"),
    SCALAR(STATE, state.x, "m", ""),
    SCALAR(STATE, state.y, "m", ""),
    SCALAR(STATE, state.heading, "rad", ""),
    VECTOR(STATE, state.speed, "rad/s", "left, right"),
    VECTOR(STATE, state.angle, "rad", "left, right"),
    SCALAR(OUTPUT, outputs.x, "m", ""),
    SCALAR(OUTPUT, outputs.y, "m", ""),
    SCALAR(OUTPUT, outputs.heading, "rad", "counterclockwise from x; it counts turns"),
    SCALAR(FEEDTHROUGH, outputs.forward_speed, "m/s", ""),
    SCALAR(FEEDTHROUGH, outputs.yaw_rate, "rad/s", "counterclockwise"),
    SCALAR(OUTPUT, outputs.speed_left, "rad/s", "of the wheel"),
    SCALAR(OUTPUT, outputs.speed_right, "rad/s", "of the wheel"),
    SCALAR(OUTPUT, outputs.angle_left, "rad", "of the wheel"),
    SCALAR(OUTPUT, outputs.angle_right, "rad", "of the wheel"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "differential_drive",
    .doc = "a vehicle on two driven wheels",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(differential_drive_t),
    .align = _Alignof(differential_drive_t),
    .continuous_offset = offsetof(differential_drive_t, state),
    .continuous_count = STATES,
    .sampled_offset = FCSL_NO_OFFSET,
    .init = init,
    .derivative = derivative,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
