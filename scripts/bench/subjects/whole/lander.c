/* SPDX-License-Identifier: Apache-2.0 */
#include "lander_by_hand.h"
#include "whole.h"

/* The lander by hand, and the samples that its step takes. */
typedef struct {
    lander_by_hand_t lander;
    double pos_z, vel_z;
} landing_t;

const whole_link_t by_hand_sensors[] = {
    {"sensors.outputs.pos_z", offsetof(landing_t, pos_z), 1, 60.0, 0.5},
    {"sensors.outputs.vel_z", offsetof(landing_t, vel_z), 1, -9.0, 0.3},
};
const size_t by_hand_sensor_count = sizeof by_hand_sensors / sizeof *by_hand_sensors;

const whole_link_t by_hand_results[] = {
    {"engine.outputs.throttle", offsetof(landing_t, lander.throttle), 1, 0.0, 0.0},
    {"filter.outputs.pos_z", offsetof(landing_t, lander.x), 1, 0.0, 0.0},
};
const size_t by_hand_result_count = sizeof by_hand_results / sizeof *by_hand_results;
const size_t by_hand_size = sizeof(landing_t);

void by_hand_init(void *by_hand)
{
    landing_t *l = by_hand;
    lander_by_hand_init(&l->lander);
    l->lander.state = HAND_DESCENT;
}

void by_hand_step(void *by_hand)
{
    landing_t *l = by_hand;
    lander_by_hand_step(&l->lander, l->pos_z, l->vel_z);
}
