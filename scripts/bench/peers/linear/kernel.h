/* SPDX-License-Identifier: Apache-2.0
 *
 * What every peer is to timing.c: a shared library with these three functions, and nothing else that others can call.
 * INPUTS numbers belong to one step.
 */
#ifndef KERNEL_H
#define KERNEL_H

#ifdef __cplusplus
extern "C" {
#endif

#pragma GCC visibility push(default)

void kernel_reset(void);
void kernel_run(const double *inputs, long steps); /* goes on from where the last run ended */
void kernel_result(double *result);                /* KERNEL_RESULTS numbers, unused ones untouched */

#pragma GCC visibility pop

enum { KERNEL_RESULTS = 256 };

#ifdef __cplusplus
}
#endif

#endif /* KERNEL_H */
