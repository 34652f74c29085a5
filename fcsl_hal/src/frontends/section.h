/* SPDX-License-Identifier: Apache-2.0
 *
 * Second-order sections (biquads), of which low-pass filters and notches are made.
 */
#ifndef FRONTENDS_SECTION_H
#define FRONTENDS_SECTION_H

#include "fcsl/fcsl_frontend.h"

/* The last two values before and behind a section. */
typedef struct {
    double x[2];
    double y[2];
    int primed;
} section_state_t;

/* One step. The first one begins in the steady state of its value: a filter does not begin with a jump from 0. */
double section_step(const fcsl_section_t *section, section_state_t *state, double x);

#endif /* FRONTENDS_SECTION_H */
