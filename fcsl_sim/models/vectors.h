/* SPDX-License-Identifier: Apache-2.0
 *
 * Vectors of three, matrices of three by three, and unit quaternions (w, x, y, z) that turn a vector of one frame into that
 * of another: `quaternion_rotate(body_to_ned, v_body, v_ned)`. Results may not lie where arguments do.
 */
#ifndef FCSL_SIM_MODELS_VECTORS_H
#define FCSL_SIM_MODELS_VECTORS_H

#include <math.h>

#include "fcsl/fcsl_math.h"

static inline double vector_dot(const double *a, const double *b)
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double vector_norm(const double *a)
{
    return sqrt(vector_dot(a, a));
}

static inline void vector_cross(const double *a, const double *b, double *c)
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

/* to = m from */
static inline void matrix_times(const double (*m)[3], const double *from, double *to)
{
    for (int i = 0; i < 3; i++) {
        to[i] = vector_dot(m[i], from);
    }
}

/* x of m x = b, by Cramer's rule; the determinant must not be zero. */
static inline void matrix_solve(const double (*m)[3], const double *b, double *x)
{
    double c0[3], c1[3], c2[3]; /* rows of the adjugate */
    const double column0[3] = {m[0][0], m[1][0], m[2][0]};
    const double column1[3] = {m[0][1], m[1][1], m[2][1]};
    const double column2[3] = {m[0][2], m[1][2], m[2][2]};
    vector_cross(column1, column2, c0);
    vector_cross(column2, column0, c1);
    vector_cross(column0, column1, c2);
    const double determinant = vector_dot(column0, c0);
    x[0] = vector_dot(c0, b) / determinant;
    x[1] = vector_dot(c1, b) / determinant;
    x[2] = vector_dot(c2, b) / determinant;
}

/* r = p q: first the turn q, then the turn p. */
static inline void quaternion_multiply(const double *p, const double *q, double *r)
{
    r[0] = p[0] * q[0] - p[1] * q[1] - p[2] * q[2] - p[3] * q[3];
    r[1] = p[0] * q[1] + p[1] * q[0] + p[2] * q[3] - p[3] * q[2];
    r[2] = p[0] * q[2] - p[1] * q[3] + p[2] * q[0] + p[3] * q[1];
    r[3] = p[0] * q[3] + p[1] * q[2] - p[2] * q[1] + p[3] * q[0];
}

static inline void quaternion_conjugate(const double *q, double *r)
{
    r[0] = q[0];
    r[1] = -q[1];
    r[2] = -q[2];
    r[3] = -q[3];
}

static inline void quaternion_normalize(const double *q, double *r)
{
    const double norm = sqrt(q[0] * q[0] + vector_dot(q + 1, q + 1));
    for (int i = 0; i < 4; i++) {
        r[i] = q[i] / norm;
    }
}

/* v' = v + 2 w (u x v) + 2 u x (u x v), with q = (w, u) of norm 1. */
static inline void quaternion_rotate(const double *q, const double *from, double *to)
{
    double once[3], twice[3];
    vector_cross(q + 1, from, once);
    vector_cross(q + 1, once, twice);
    for (int i = 0; i < 3; i++) {
        to[i] = from[i] + 2.0 * (q[0] * once[i] + twice[i]);
    }
}

/* The other way: a vector of the frame that `q` turns into, in the frame that it turns from. */
static inline void quaternion_rotate_back(const double *q, const double *from, double *to)
{
    double back[4];
    quaternion_conjugate(q, back);
    quaternion_rotate(back, from, to);
}

/* A turn by roll, pitch and yaw (rad): yaw about z, then pitch about the new y, then roll about the new x. */
static inline void quaternion_from_euler(double roll, double pitch, double yaw, double *q)
{
    const double cr = cr_cos(0.5 * roll), sr = cr_sin(0.5 * roll);
    const double cp = cr_cos(0.5 * pitch), sp = cr_sin(0.5 * pitch);
    const double cy = cr_cos(0.5 * yaw), sy = cr_sin(0.5 * yaw);
    q[0] = cr * cp * cy + sr * sp * sy;
    q[1] = sr * cp * cy - cr * sp * sy;
    q[2] = cr * sp * cy + sr * cp * sy;
    q[3] = cr * cp * sy - sr * sp * cy;
}

#endif /* FCSL_SIM_MODELS_VECTORS_H */
