/* SPDX-License-Identifier: Apache-2.0
 *
 * The drivers that come with FCSL.
 */
#include "driver_log.h"

const fcsl_driver_t *const fcsl_drivers_built_in[] = {&fcsl_driver_log, NULL};
