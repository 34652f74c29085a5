/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_LOAD_H
#define FCSL_LOAD_H

#include "error.h"

/* dlopen of a file as a user names it; null with `error`, which calls it a `what` library. */
void *fcsl_load_library(const char *library, const char *what, fcsl_error_t *error);

#endif /* FCSL_LOAD_H */
