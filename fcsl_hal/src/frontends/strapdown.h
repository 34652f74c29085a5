/* SPDX-License-Identifier: Apache-2.0
 *
 * Rotation and change of velocity over a tick from rates and accelerations that come faster: what an attitude filter that runs once a
 * tick would lose by taking the last of them (coning and sculling).
 *
 * P. G. Savage, Strapdown Inertial Navigation Integration Algorithm Design, parts 1 and 2, Journal of Guidance, Control, and Dynamics 21,
 * 1998: the second-order algorithms for a rate and an acceleration that change linearly between samples.
 */
#ifndef FRONTENDS_STRAPDOWN_H
#define FRONTENDS_STRAPDOWN_H

typedef struct {
    double rate[3]; /* of the last sample */
    double accel[3];
    int primed; /* there was one */
    double d_angle[3]; /* over the last interval */
    double d_velocity[3];
    double angle[3]; /* sums since the last take */
    double velocity[3];
    double coning[3];
    double sculling[3];
    double time_s;
} strapdown_t;

/* A sample that came `dt_s` after the last one. The first one, and one with dt_s 0, only begins an interval. */
void strapdown_add(strapdown_t *strapdown, const double rate[3], const double accel[3], double dt_s);
/* What came together since the last call: a rotation vector in rad, and a change of velocity in m/s, both in the axes at the beginning;
 * and how long that was. */
void strapdown_take(strapdown_t *strapdown, double delta_angle[3], double delta_velocity[3], double *delta_time_s);

#endif /* FRONTENDS_STRAPDOWN_H */
