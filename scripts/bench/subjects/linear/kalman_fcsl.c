/* SPDX-License-Identifier: Apache-2.0
 *
 * The Kalman filter as fcslc compiles it: one instance, `filter` of machine `bench`, through its execute.
 */
#include "bench.h"
#include "kernel.h"

#include <string.h>

static bench_filter_t self;

void kernel_reset(void)
{
    bench_filter_init(&self);
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        memcpy(self.inputs.z, &inputs[3 * k], sizeof self.inputs.z);
        bench_filter_execute(&self);
    }
}

void kernel_result(double *result)
{
    memcpy(result, self.outputs.x, sizeof self.outputs.x);
    memcpy(result + sizeof self.outputs.x / sizeof(double), self.state.p, sizeof self.state.p);
}
