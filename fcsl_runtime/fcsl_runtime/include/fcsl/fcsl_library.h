/* SPDX-License-Identifier: Apache-2.0
 *
 * Libraries that a host loads: of machines, boards and plants.
 */
#ifndef FCSL_LIBRARY_H
#define FCSL_LIBRARY_H

#include "fcsl/fcsl_run.h"

/* dlopen of a file as a user names it; null with `error`, which calls it a `what` library. What is no regular file (a FIFO
 * would be waited for, without an end) and what ends before that which is loaded of it (whoever touched what is missing would
 * get a SIGBUS) is refused. */
void *fcsl_library_open(const char *library, const char *what, fcsl_error_t *error);

#endif /* FCSL_LIBRARY_H */
