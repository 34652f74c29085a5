/* SPDX-License-Identifier: Apache-2.0
 *
 * The lander's controller as an engineer would write it by hand in C: one struct, one function, a switch over states.
 * The same logic as examples/lander/fc, without instances, health bookkeeping, channels or schedules. For `make bench`.
 */
#ifndef LANDER_BY_HAND_H
#define LANDER_BY_HAND_H

#include <stdbool.h>
#include <stdint.h>

typedef enum { HAND_ASCENT, HAND_COAST, HAND_DESCENT, HAND_SAFE } hand_state_t;

typedef struct {
    hand_state_t state;
    bool initialised;
    double x[2];
    double p[2][2];
    double pos_lost;
    double vel_lost;
    double still;
    double mass;
    double acceleration;
    bool landed;
    double throttle;
} lander_by_hand_t;

void lander_by_hand_init(lander_by_hand_t *l);
/* One tick of 0.01 s with this tick's samples; the throttle is in l->throttle. */
void lander_by_hand_step(lander_by_hand_t *l, double pos_z, double vel_z);

#endif /* LANDER_BY_HAND_H */
