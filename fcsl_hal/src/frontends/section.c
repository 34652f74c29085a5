/* SPDX-License-Identifier: Apache-2.0
 *
 * Second-order sections.
 */
#include "frontends/section.h"

double section_step(const fcsl_section_t *section, section_state_t *state, double x)
{
    const double *b = section->b;
    const double *a = section->a;
    if (!state->primed) {
        const double steady = (b[0] + b[1] + b[2]) / (1.0 + a[0] + a[1]) * x;
        *state = (section_state_t){.x = {x, x}, .y = {steady, steady}, .primed = 1};
    }
    const double y = b[0] * x + b[1] * state->x[0] + b[2] * state->x[1] - a[0] * state->y[0] - a[1] * state->y[1];
    state->x[1] = state->x[0];
    state->x[0] = x;
    state->y[1] = state->y[0];
    state->y[0] = y;
    return y;
}
