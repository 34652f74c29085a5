/* SPDX-License-Identifier: Apache-2.0
 *
 * The Kalman filter as CasADi generates it from SX expressions: (x, p, z) to (x, p). Its arguments must not overlap its
 * results, so there are two of each, which take turns: nothing is copied.
 */
#include "kernel.h"
#include "model.h"
/* Made by CasADi; included, so that the C compiler may inline it as it may FCSL's. */
#include "peer.c"

#include <string.h>

static double x[2][N], p[2][N * N];
static int now;

void kernel_reset(void)
{
    memset(x, 0, sizeof x);
    memset(p, 0, sizeof p);
    now = 0;
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        const double *arguments[] = {x[now], p[now], &inputs[3 * k]};
        double *results[] = {x[1 - now], p[1 - now]};
        peer(arguments, results, NULL, NULL, 0);
        now = 1 - now;
    }
}

void kernel_result(double *result)
{
    memcpy(result, x[now], sizeof x[now]);
    for (int i = 0; i < N; ++i) { /* CasADi stores by columns */
        for (int j = 0; j < N; ++j) {
            result[N + i * N + j] = p[now][j * N + i];
        }
    }
}
