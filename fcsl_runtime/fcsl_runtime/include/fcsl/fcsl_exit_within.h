/* SPDX-License-Identifier: Apache-2.0
 *
 * The end of a process whose work is done.
 */
#ifndef FCSL_EXIT_WITHIN_H
#define FCSL_EXIT_WITHIN_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* The process ends with `status` after `ms` at the latest, by _exit, if nothing ends it before: for a host that must call
 * destructors of libraries that may hang. Once per process. 0, or -1: no thread could be made. */
int fcsl_exit_within(uint32_t ms, int status);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_EXIT_WITHIN_H */
