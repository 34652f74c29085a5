/* SPDX-License-Identifier: Apache-2.0
 *
 * The allocator and what it gets memory from, in place of the C library's, for the whole process: while it counts, every
 * call is counted and refused.
 */
#ifndef FCSL_VERIFY_COUNTED_H
#define FCSL_VERIFY_COUNTED_H

#include <stdbool.h>
#include <stdint.h>

extern bool counted_armed;     /* from the first tick to the last */
extern uint64_t counted_calls; /* made meanwhile */

#endif /* FCSL_VERIFY_COUNTED_H */
