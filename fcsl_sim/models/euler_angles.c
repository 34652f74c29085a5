/* SPDX-License-Identifier: Apache-2.0
 *
 * Roll, pitch and yaw of an attitude: the turn by yaw about down, then by pitch about the new right, then by roll about
 * the new forward axis.
 *
 *   (roll + yaw) / 2 = atan2(x + z, w - y),   (roll - yaw) / 2 = atan2(x - z, w + y)
 *   pitch = 2 atan2(|(x - z, w + y)|, |(x + z, w - y)|) - pi/2
 *
 * Near pitch = +-pi/2 these keep all their digits, while the usual formula by asin loses half of them. Within 1.4e-10
 * rad of there only roll - yaw or roll + yaw has a meaning: roll is 0.
 *
 * Source: E. Bernardes, S. Viollet, Quaternion to Euler angles conversion: a direct, general and computationally
 * efficient method, PLOS ONE 17 (2022) e0276302.
 */
#include "fcsl/fcsl_model.h"

static const double PI = 3.14159265358979323846;
static const double VERTICAL = 1e-10; /* a pair of components so short has no direction */

typedef struct {
    struct {
        double attitude_body_to_ned[4];
    } inputs;
    struct {
        double roll, pitch, yaw;
    } outputs;
} euler_angles_t;

/* An angle of (-2 pi, 2 pi] in (-pi, pi]. */
static double wrapped(double angle)
{
    return angle > PI ? angle - 2.0 * PI : angle <= -PI ? angle + 2.0 * PI : angle;
}

static void output(void *self, double t, const double *x)
{
    euler_angles_t *euler = self;
    (void)t, (void)x;
    const double *q = euler->inputs.attitude_body_to_ned;
    const double sum_sine = q[1] + q[3], sum_cosine = q[0] - q[2];
    const double difference_sine = q[1] - q[3], difference_cosine = q[0] + q[2];
    const double sum_length = sqrt(sum_sine * sum_sine + sum_cosine * sum_cosine);
    const double difference_length = sqrt(difference_sine * difference_sine + difference_cosine * difference_cosine);
    double half_sum = cr_atan2(sum_sine, sum_cosine);
    double half_difference = cr_atan2(difference_sine, difference_cosine);
    if (sum_length < VERTICAL) {
        half_sum = -half_difference;
    } else if (difference_length < VERTICAL) {
        half_difference = -half_sum;
    }
    euler->outputs.roll = wrapped(half_sum + half_difference);
    euler->outputs.pitch = 2.0 * cr_atan2(difference_length, sum_length) - 0.5 * PI;
    euler->outputs.yaw = wrapped(half_sum - half_difference);
}

static const fcsl_field_t fields[] = {
    FCSL_MODEL_VECTOR(euler_angles_t, FCSL_ROLE_INPUT, inputs.attitude_body_to_ned, "", "w, x, y, z"),
    FCSL_MODEL_SCALAR(euler_angles_t, FCSL_ROLE_FEEDTHROUGH, outputs.roll, "rad", "-pi to pi, right wing down"),
    FCSL_MODEL_SCALAR(euler_angles_t, FCSL_ROLE_FEEDTHROUGH, outputs.pitch, "rad", "-pi/2 to pi/2, nose up"),
    FCSL_MODEL_SCALAR(euler_angles_t, FCSL_ROLE_FEEDTHROUGH, outputs.yaw, "rad", "-pi to pi, from north to the east"),
};

static const fcsl_model_t model = {
    .abi_version = FCSL_MODEL_ABI_VERSION,
    .name = "euler_angles",
    .doc = "roll, pitch and yaw of an attitude",
    .fields = fields,
    .field_count = sizeof fields / sizeof *fields,
    .size = sizeof(euler_angles_t),
    .align = _Alignof(euler_angles_t),
    .sampled_offset = FCSL_NO_OFFSET,
    .output = output,
};

const fcsl_model_t *const fcsl_models[] = {&model, NULL};
