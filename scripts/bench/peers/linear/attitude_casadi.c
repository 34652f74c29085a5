/* SPDX-License-Identifier: Apache-2.0
 *
 * The attitude controller as CasADi generates it from SX expressions: (integral, q, rate, q_wanted, rate_wanted) to
 * (integral, torque). The integral takes turns between two places.
 */
#include "kernel.h"
/* Made by CasADi; included, so that the C compiler may inline it as it may FCSL's. */
#include "peer.c"

#include <string.h>

static double integral[2][3], torque[3];
static int now;

void kernel_reset(void)
{
    memset(integral, 0, sizeof integral);
    now = 0;
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        const double *u = &inputs[14 * k];
        const double *arguments[] = {integral[now], u, u + 4, u + 7, u + 11};
        double *results[] = {integral[1 - now], torque};
        peer(arguments, results, NULL, NULL, 0);
        now = 1 - now;
    }
}

void kernel_result(double *result)
{
    memcpy(result, torque, sizeof torque);
    memcpy(result + 3, integral[now], sizeof integral[now]);
}
