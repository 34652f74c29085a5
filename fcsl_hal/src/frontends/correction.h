/* SPDX-License-Identifier: Apache-2.0
 *
 * Corrections of readings: bias, scale, mounting and temperature; sticks of a remote control.
 */
#ifndef FRONTENDS_CORRECTION_H
#define FRONTENDS_CORRECTION_H

#include "fcsl/fcsl_frontend.h"

/* Corrects `count` elements in place: a vector of 3, or the first one alone. `celsius`: NaN when it is not known. */
void correct(const fcsl_correction_t *correction, double celsius, uint32_t count, double *values);

/* A pulse in us as a stick in [-1, 1]; NaN stays. */
double stick_of(const fcsl_stick_t *stick, double pulse_us);

#endif /* FRONTENDS_CORRECTION_H */
