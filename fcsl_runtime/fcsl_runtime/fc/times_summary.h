/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FC_TIMES_SUMMARY_H
#define FC_TIMES_SUMMARY_H

#include "fcsl/fcsl_run.h"

/* Prints where the time of the steps went: a line for each instance of a measured machine, the largest share first. */
void report_instance_times(const fcsl_run_t *run);

#endif /* FC_TIMES_SUMMARY_H */
