/* SPDX-License-Identifier: Apache-2.0
 *
 * Encoders of a left and a right wheel, and the pose of the vehicle that follows from their counts (dead reckoning).
 *
 * left' = v + w b / 2,  right' = v - w b / 2                    v: forward speed, w: yaw rate, b: track_width
 * d_i = (1 + scale_error_i) D_i + slip sqrt(|D_i|) n            D_i: distance of a wheel since the last update
 * d = (d_left + d_right) / 2,  a = (d_left - d_right) / b       of whole ticks; the rest of a tick is counted later
 * x += c cos(yaw + a / 2),  y += c sin(yaw + a / 2)             c = 2 d / a sin(a / 2)
 * yaw += a,  forward_speed = d / T,  yaw_rate = a / T           T: time since the last update
 *
 * The pose is x forward, y right, yaw to the right, all zero at the first update. An arc of a circle is exact.
 *
 * Source: R. Siegwart, I. R. Nourbakhsh, D. Scaramuzza, Introduction to Autonomous Mobile Robots, 2nd ed. (2011),
 * section 5.2.4: the variance of a wheel's distance is proportional to the distance; J. Borenstein, L. Feng,
 * Measurement and correction of systematic odometry errors in mobile robots, IEEE Transactions on Robotics and
 * Automation 12 (1996) 869-880 (unequal wheels).
 *
 * Limits: flat ground, no lateral slip; slip has the mean 0, so a wheel that spins does not show.
 */
#include "sensor_errors.h"

#define PI 3.14159265358979323846

enum { LEFT, RIGHT, WHEELS };

typedef struct {
    double forward_speed;
    double yaw_rate;
    double x, y, yaw;
    bool sampled;
} wheel_odometry_outputs_t;

typedef struct {
    struct {
        double velocity_body[3];
        double rate_body[3];
    } inputs;
    struct {
        double track_width;
        double scale_error_left, scale_error_right;
        double slip;
        double tick_distance;
        double dropout_probability;
        uint32_t delay_samples;
        uint32_t fault;
    } parameters;
    struct {
        double distance[WHEELS]; /* integrated, from the last update on */
        double rolled[WHEELS]; /* with errors, before it is counted */
        double x, y, yaw;
        sensor_line_t line;
    } state;
    wheel_odometry_outputs_t outputs;
} wheel_odometry_t;

static const char *init(void *self, const fcsl_model_context_t *context)
{
    const wheel_odometry_t *wheels = self;
    (void)context;
    if (!(wheels->parameters.track_width > 0.0)) {
        return "parameters.track_width must be positive";
    }
    if (!(wheels->parameters.slip >= 0.0)) {
        return "parameters.slip must not be negative";
    }
    if (!(wheels->parameters.tick_distance >= 0.0)) {
        return "parameters.tick_distance must not be negative";
    }
    return sensor_check_losses(SENSOR_LOSSES(wheels));
}

static void derivative(const void *self, double t, const double *x, double *dx)
{
    const wheel_odometry_t *wheels = self;
    (void)t, (void)x;
    const double forward = wheels->inputs.velocity_body[0];
    const double across = 0.5 * wheels->parameters.track_width * wheels->inputs.rate_body[2];
    dx[LEFT] = forward + across;
    dx[RIGHT] = forward - across;
}

/* A model with integrated states has this function. `update` writes all outputs. */
static void output(void *self, double t, const double *x)
{
    (void)self, (void)t, (void)x;
}

/* What the encoder of a wheel counts since the last update, m. The rest of a tick remains. */
static double count(wheel_odometry_t *wheels, int wheel, double scale_error, const fcsl_model_context_t *context)
{
    const double tick = wheels->parameters.tick_distance;
    const double distance = sensor_feel(SENSOR_LOSSES(wheels), wheels->state.distance[wheel]);
    const double slipped = wheels->parameters.slip * sqrt(fabs(distance)) * sensor_gaussian(context, SENSOR_NOISE);
    wheels->state.distance[wheel] = 0.0;
    wheels->state.rolled[wheel] += distance + scale_error * distance + slipped;
    const double counted = tick > 0.0 ? tick * floor(wheels->state.rolled[wheel] / tick) : wheels->state.rolled[wheel];
    wheels->state.rolled[wheel] -= counted;
    return counted;
}

static void move(wheel_odometry_t *wheels, double distance, double angle)
{
    const double half = 0.5 * angle;
    const double chord = half == 0.0 ? distance : distance * cr_sin(half) / half;
    wheels->state.x += chord * cr_cos(wheels->state.yaw + half);
    wheels->state.y += chord * cr_sin(wheels->state.yaw + half);
    wheels->state.yaw += angle;
    wheels->state.yaw -= 2.0 * PI * round(wheels->state.yaw / (2.0 * PI));
}

static void update(void *self, const fcsl_model_context_t *context)
{
    wheel_odometry_t *wheels = self;
    const double interval = sensor_interval(&wheels->state.line, context);
    if (!isfinite(interval)) { /* the first count is zero */
        wheels->state.distance[LEFT] = 0.0;
        wheels->state.distance[RIGHT] = 0.0;
    }
    const double left = count(wheels, LEFT, wheels->parameters.scale_error_left, context);
    const double right = count(wheels, RIGHT, wheels->parameters.scale_error_right, context);
    const double distance = 0.5 * (left + right);
    const double angle = (left - right) / wheels->parameters.track_width;
    move(wheels, distance, angle);
    const wheel_odometry_outputs_t sample = {.forward_speed = distance / interval,
                                             .yaw_rate = angle / interval,
                                             .x = wheels->state.x,
                                             .y = wheels->state.y,
                                             .yaw = wheels->state.yaw};
    wheels->outputs.sampled = sensor_deliver(&wheels->state.line, SENSOR_LOSSES(wheels), context, true, &sample,
                                             &wheels->outputs, offsetof(wheel_odometry_outputs_t, sampled));
}

#define FIELD(role, path, unit, doc) FCSL_MODEL_SCALAR(wheel_odometry_t, FCSL_ROLE_##role, path, unit, doc)

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(wheel_odometry_t, FCSL_ROLE_INPUT, inputs.velocity_body, "m/s",
                      "midway between the wheels; x counts"),
    FCSL_MODEL_VECTOR(wheel_odometry_t, FCSL_ROLE_INPUT, inputs.rate_body, "rad/s", "z counts"),
    FIELD(PARAMETER, parameters.track_width, "m", "between the wheels"),
    FIELD(OPTIONAL_PARAMETER, parameters.scale_error_left, "", "of the distance of the left wheel"),
    FIELD(OPTIONAL_PARAMETER, parameters.scale_error_right, "", "of the distance of the right wheel"),
    FIELD(OPTIONAL_PARAMETER, parameters.slip, "m/sqrt(m)",
          "standard deviation of the distance of each wheel after 1 m"),
    FIELD(OPTIONAL_PARAMETER, parameters.tick_distance, "m", "distance of one tick; 0: not counted in ticks"),
    FCSL_MODEL_VECTOR(wheel_odometry_t, FCSL_ROLE_STATE, state.distance, "m", "left and right, since the last update"),
    FIELD(STATE, state.x, "m", "of the pose before the delay"),
    FIELD(STATE, state.y, "m", ""),
    FIELD(STATE, state.yaw, "rad", ""),
    FIELD(OUTPUT, outputs.forward_speed, "m/s", "mean since the sample before"),
    FIELD(OUTPUT, outputs.yaw_rate, "rad/s", "mean since the sample before, to the right"),
    FIELD(OUTPUT, outputs.x, "m", "forward, from where it began"),
    FIELD(OUTPUT, outputs.y, "m", "right, from where it began"),
    FIELD(OUTPUT, outputs.yaw, "rad", "to the right, from -pi to pi"),
    SENSOR_FIELDS(wheel_odometry_t),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "wheel_odometry",
    .doc = "wheel encoders with slip, unequal wheels and ticks, and their dead reckoning",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(wheel_odometry_t),
    .align = _Alignof(wheel_odometry_t),
    .continuous_offset = offsetof(wheel_odometry_t, state),
    .continuous_count = WHEELS,
    .sampled_offset = offsetof(wheel_odometry_t, outputs.sampled),
    .init = init,
    .derivative = derivative,
    .output = output,
    .update = update,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
