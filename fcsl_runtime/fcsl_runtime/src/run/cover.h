/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_COVER_HOST_H
#define FCSL_COVER_HOST_H

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_machine.h"

/* Lets a machine that was built for coverage count into its file in the folder that FCSL_COVER_DIR names; does nothing
   with any other machine. A build for coverage is refused where that folder is not named: it is not made to be flown. */
int fcsl_cover_attach(void *library, const char *path, const fcsl_machine_t *machine, fcsl_error_t *error);

#endif /* FCSL_COVER_HOST_H */
