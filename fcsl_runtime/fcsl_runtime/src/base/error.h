/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_ERROR_H
#define FCSL_ERROR_H

#include "fcsl/fcsl_run.h"

/* Fills `error` (may be null) as printf does and returns -1. */
__attribute__((format(printf, 2, 3))) int fcsl_fail(fcsl_error_t *error, const char *format, ...);

#endif /* FCSL_ERROR_H */
