/* SPDX-License-Identifier: Apache-2.0
 *
 * A ball that bounces without end: 2 states, 1 event.
 */
#ifndef BENCH_BALL_H
#define BENCH_BALL_H

enum { BALL_STATES = 2, BALL_EVENTS = 1 };

typedef struct {
    struct {
        double gravity, restitution, height;
    } parameters;
    struct {
        double x[BALL_STATES]; /* height, speed */
    } state;
    struct {
        double x[BALL_STATES];
    } outputs;
} ball_t;

static inline void ball_derivative(const ball_t *ball, const double *x, double *dx)
{
    dx[0] = x[1];
    dx[1] = -ball->parameters.gravity;
}

static inline void ball_event(const ball_t *ball, const double *x, double *value)
{
    (void)ball;
    value[0] = x[0];
}

static inline void ball_reset(ball_t *ball, unsigned number)
{
    (void)number;
    ball->state.x[0] = 0.0;
    ball->state.x[1] = -ball->parameters.restitution * ball->state.x[1];
}

#endif /* BENCH_BALL_H */
