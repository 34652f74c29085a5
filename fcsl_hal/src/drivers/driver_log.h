/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_DRIVER_LOG_H
#define FCSL_DRIVER_LOG_H

#include "fcsl/fcsl_driver.h"

/* An actuator that is a file: it holds the last writes, each with its time. */
extern const fcsl_driver_t fcsl_driver_log;

#endif /* FCSL_DRIVER_LOG_H */
