/* SPDX-License-Identifier: Apache-2.0 */
#include "plants_by_hand.h"

#include <string.h>

enum { STATES_MAX = 18, EVENTS_MAX = 3 };

#define HZ       1000.0
#define NS_PER_S 1e9
#define STEP_NS  1000000

#define INLINED static inline __attribute__((always_inline))

/* One plant as its loop sees it. All are constants where they are used, so that calls are inlined and loops unrolled. */
typedef void slope_t(const void *plant, const double *x, double *dx);
typedef void event_t(const void *plant, const double *x, double *value);
typedef void reset_t(void *plant, unsigned number);
typedef int crosses_t(unsigned number, double before, double after);

INLINED void rk4(slope_t *slope, const void *plant, int n, double h, const double *x0, double *x1)
{
    double k1[STATES_MAX], k2[STATES_MAX], k3[STATES_MAX], k4[STATES_MAX], x[STATES_MAX];
    const double half = 0.5 * h;
    const double sixth = h / 6.0;
    slope(plant, x0, k1);
    for (int i = 0; i < n; i++) {
        x[i] = x0[i] + half * k1[i];
    }
    slope(plant, x, k2);
    for (int i = 0; i < n; i++) {
        x[i] = x0[i] + half * k2[i];
    }
    slope(plant, x, k3);
    for (int i = 0; i < n; i++) {
        x[i] = x0[i] + h * k3[i];
    }
    slope(plant, x, k4);
    for (int i = 0; i < n; i++) {
        x1[i] = x0[i] + sixth * (((k1[i] + 2.0 * k2[i]) + 2.0 * k3[i]) + k4[i]);
    }
}

/* ---- plants with events ------------------------------------------------------------------------------------------------ */

INLINED int any(crosses_t *crosses, int events, const double *before, const double *after)
{
    int happens = 0;
    for (int i = 0; i < events; i++) {
        happens |= crosses((unsigned)i, before[i], after[i]);
    }
    return happens;
}

/* A step in which something happens: up to there, the reset, and on from there. */
INLINED void step_with_events(slope_t *slope, event_t *event, reset_t *reset, crosses_t *crosses, void *plant,
                              double *state, int n, int events, uint64_t step, double *x, double *g)
{
    double x1[STATES_MAX], g1[EVENTS_MAX];
    int64_t from_ns = 0;
    for (;;) {
        const double begin_s = (double)((int64_t)step * STEP_NS + from_ns) / NS_PER_S;
        const double h = from_ns == 0 ? 1.0 / HZ : (double)(step + 1u) / HZ - begin_s;
        rk4(slope, plant, n, h, x, x1);
        event(plant, x1, g1);
        if (!any(crosses, events, g, g1)) {
            break;
        }
        int64_t before_ns = 0, after_ns = STEP_NS - from_ns;
        while (after_ns - before_ns > 1) {
            const int64_t middle_ns = before_ns + (after_ns - before_ns) / 2;
            double probe[STATES_MAX], value[EVENTS_MAX];
            rk4(slope, plant, n, (double)middle_ns / NS_PER_S, x, probe);
            event(plant, probe, value);
            if (any(crosses, events, g, value)) {
                after_ns = middle_ns;
                memcpy(x1, probe, sizeof x1);
                memcpy(g1, value, sizeof g1);
            } else {
                before_ns = middle_ns;
            }
        }
        memcpy(state, x1, (size_t)n * sizeof *state);
        for (int i = 0; i < events; i++) {
            if (crosses((unsigned)i, g[i], g1[i])) {
                reset(plant, (unsigned)i);
            }
        }
        memcpy(x, state, (size_t)n * sizeof *x);
        event(plant, x, g);
        from_ns += after_ns;
        if (from_ns == STEP_NS) {
            return;
        }
    }
    memcpy(x, x1, sizeof x1);
    memcpy(g, g1, sizeof g1);
}

/* ---- loops ----------------------------------------------------------------------------------------------------------- */

/* The derivative, inlined, and as a function of its own, of which the loop knows nothing. */
#define SLOPES(plant_)                                                                                                 \
    INLINED void plant_##_slope(const void *plant, const double *x, double *dx)                                        \
    {                                                                                                                  \
        plant_##_derivative(plant, x, dx);                                                                             \
    }                                                                                                                  \
    static __attribute__((noipa)) void plant_##_slope_apart(const void *plant, const double *x, double *dx)            \
    {                                                                                                                  \
        plant_##_derivative(plant, x, dx);                                                                             \
    }

#define SMOOTH_LOOP(plant_, STATES_, run_, slope_)                                                                     \
    static void run_(void *self, uint64_t step, uint32_t steps)                                                        \
    {                                                                                                                  \
        plant_##_t *plant = self;                                                                                      \
        const double h = 1.0 / HZ;                                                                                     \
        double x[STATES_MAX];                                                                                          \
        (void)step;                                                                                                    \
        memcpy(x, plant->state.x, sizeof plant->state.x);                                                              \
        for (uint32_t k = 0; k < steps; k++) {                                                                         \
            rk4(slope_, plant, STATES_, h, x, x);                                                                      \
        }                                                                                                              \
        memcpy(plant->state.x, x, sizeof plant->state.x);                                                              \
    }

#define SMOOTH(plant_, STATES_)                                                                                        \
    SLOPES(plant_)                                                                                                     \
    SMOOTH_LOOP(plant_, STATES_, plant_##_run, plant_##_slope)                                                         \
    SMOOTH_LOOP(plant_, STATES_, plant_##_run_apart, plant_##_slope_apart)

#define EVENTFUL_LOOP(plant_, STATES_, EVENTS_, run_, slope_)                                                          \
    static void run_(void *self, uint64_t step, uint32_t steps)                                                        \
    {                                                                                                                  \
        plant_##_t *plant = self;                                                                                      \
        const double h = 1.0 / HZ;                                                                                     \
        double x[STATES_MAX], x1[STATES_MAX], g[EVENTS_MAX], g1[EVENTS_MAX];                                           \
        memcpy(x, plant->state.x, sizeof plant->state.x);                                                              \
        plant_##_event(plant, x, g);                                                                                   \
        for (uint32_t k = 0; k < steps; k++) {                                                                         \
            rk4(slope_, plant, STATES_, h, x, x1);                                                                     \
            plant_##_event(plant, x1, g1);                                                                             \
            if (any(plant_##_crosses, EVENTS_, g, g1)) {                                                               \
                plant_##_happens(plant, step + k, x, g);                                                               \
                continue;                                                                                              \
            }                                                                                                          \
            memcpy(x, x1, (STATES_) * sizeof *x);                                                                      \
            memcpy(g, g1, (EVENTS_) * sizeof *g);                                                                      \
        }                                                                                                              \
        memcpy(plant->state.x, x, sizeof plant->state.x);                                                              \
    }

#define EVENTFUL(plant_, STATES_, EVENTS_)                                                                             \
    SLOPES(plant_)                                                                                                     \
    INLINED void plant_##_values(const void *plant, const double *x, double *value)                                    \
    {                                                                                                                  \
        plant_##_event(plant, x, value);                                                                               \
    }                                                                                                                  \
    INLINED void plant_##_jump(void *plant, unsigned number)                                                           \
    {                                                                                                                  \
        plant_##_reset(plant, number);                                                                                 \
    }                                                                                                                  \
    static __attribute__((noinline)) void plant_##_happens(plant_##_t *plant, uint64_t step, double *x, double *g)     \
    {                                                                                                                  \
        step_with_events(plant_##_slope, plant_##_values, plant_##_jump, plant_##_crosses, plant, plant->state.x,      \
                         STATES_, EVENTS_, step, x, g);                                                                \
    }                                                                                                                  \
    EVENTFUL_LOOP(plant_, STATES_, EVENTS_, plant_##_run, plant_##_slope)                                              \
    EVENTFUL_LOOP(plant_, STATES_, EVENTS_, plant_##_run_apart, plant_##_slope_apart)

INLINED int falls(double before, double after)
{
    return before >= 0.0 && after < 0.0;
}

INLINED int lander_crosses(unsigned number, double before, double after)
{
    return number == LANDER_LIFT_OFF ? before <= 0.0 && after > 0.0 : falls(before, after);
}

INLINED int ball_crosses(unsigned number, double before, double after)
{
    (void)number;
    return falls(before, after);
}

EVENTFUL(lander, LANDER_STATES, LANDER_EVENTS)
EVENTFUL(ball, BALL_STATES, BALL_EVENTS)
SMOOTH(bodies, BODIES_STATES)
SMOOTH(quadrotor, QUADROTOR_STATES)
SMOOTH(satellite, SATELLITE_STATES)

#define BY_HAND(plant_, STATES_)                                                                                       \
    {#plant_, plant_##_run, plant_##_run_apart, sizeof(plant_##_t), offsetof(plant_##_t, state.x), STATES_}

const by_hand_plant_t by_hand_plants[] = {
    BY_HAND(lander, LANDER_STATES),       BY_HAND(ball, BALL_STATES),           BY_HAND(bodies, BODIES_STATES),
    BY_HAND(quadrotor, QUADROTOR_STATES), BY_HAND(satellite, SATELLITE_STATES),
};
const uint32_t by_hand_count = sizeof by_hand_plants / sizeof *by_hand_plants;
