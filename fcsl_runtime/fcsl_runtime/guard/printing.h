/* SPDX-License-Identifier: Apache-2.0
 *
 * Lines of the guard, printed by a thread of their own: a terminal, a pipe or a disk that does not take them keeps no actuator
 * waiting.
 */
#ifndef GUARD_PRINTING_H
#define GUARD_PRINTING_H

#include "fcsl/fcsl_run.h"

/* Starts the thread, with the priority of the caller. 0, or -1. */
int printing_start(fcsl_error_t *error);
/* Prints what is left, for 1 s at most, and ends the thread if it was started. */
void printing_end(void);

/* From one thread, after printing_start: log_info and log_error that never wait. A line that finds no room is dropped and
 * counted. */
__attribute__((format(printf, 1, 2))) void print_info(const char *format, ...);
__attribute__((format(printf, 1, 2))) void print_error(const char *format, ...);

#endif /* GUARD_PRINTING_H */
