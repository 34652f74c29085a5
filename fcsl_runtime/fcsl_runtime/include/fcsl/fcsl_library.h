/* SPDX-License-Identifier: Apache-2.0
 *
 * Libraries that a host loads: of machines, boards, drivers and plants.
 */
#ifndef FCSL_LIBRARY_H
#define FCSL_LIBRARY_H

#include "fcsl/fcsl_driver.h"
#include "fcsl/fcsl_run.h"

/* dlopen of a file as a user names it; null with `error`, which calls it a `what` library. What is no regular file (a FIFO
 * would be waited for, without an end) and what ends before that which is loaded of it (whoever touched what is missing would
 * get a SIGBUS) is refused. */
void *fcsl_library_open(const char *library, const char *what, fcsl_error_t *error);

/* The machine with its fields: itself, or if they are folded a copy that has them. Null with `error`, also for folds that do not
 * make field_count fields. *made is for free(), when the copy is not used any more; null without one. */
const fcsl_machine_t *fcsl_library_unfold(const fcsl_machine_t *machine, void **made, fcsl_error_t *error);

/* The descriptor of a machine, chosen, unfolded and checked as fcsl_run_open does; none of its code runs. Null with `error`.
 * *handle is for dlclose, *made for free(), when the descriptor is not used any more. */
const fcsl_machine_t *fcsl_library_machine(const char *library, const char *name, void **handle, void **made,
                                           fcsl_error_t *error);

/* The driver of this direction that a user names: NAME, one that comes with FCSL, or LIBRARY.so:NAME. Null with `error`, which
 * says what there is. *handle is for dlclose, when nothing of the driver is used any more; null for a driver without a library. */
const fcsl_driver_t *fcsl_library_driver(const char *name, fcsl_direction_t direction, void **handle,
                                         fcsl_error_t *error);
/* Where NAME begins in "LIBRARY.so:NAME…"; 0 without a library. */
size_t fcsl_library_driver_name(const char *name);

#endif /* FCSL_LIBRARY_H */
