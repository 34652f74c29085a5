/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_OBSERVERS_DESCRIPTOR_H
#define FCSL_OBSERVERS_DESCRIPTOR_H

#include "fcsl/fcsl_run.h"

/* What an observer needs to read the machine's channels, as JSON (docs/reference/transports.md). Freed by the caller; null with `error`. */
char *fcsl_observers_descriptor(const fcsl_machine_t *machine, fcsl_error_t *error);

#endif /* FCSL_OBSERVERS_DESCRIPTOR_H */
