/* SPDX-License-Identifier: Apache-2.0
 *
 * The attitude controller as fcslc compiles it: one instance, `control` of machine `bench`, through its execute.
 */
#include "bench.h"
#include "kernel.h"

#include <string.h>

static bench_control_t self;

void kernel_reset(void)
{
    bench_control_init(&self);
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        memcpy(&self.inputs, &inputs[14 * k], 14 * sizeof(double)); /* its fields in their order */
        bench_control_execute(&self);
    }
}

void kernel_result(double *result)
{
    memcpy(result, self.outputs.torque, sizeof self.outputs.torque);
    memcpy(result + 3, self.state.trim, sizeof self.state.trim);
}
