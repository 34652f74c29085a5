/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_HISTOGRAM_JSON_H
#define FCSL_HISTOGRAM_JSON_H

#include "histogram.h"
#include "vars/json.h"

/* A member of an object that is being written: the summary, and `buckets`, pairs of a bucket's largest value and its count,
 * of buckets that hold any. */
void histogram_json(json_out_t *out, const char *name, const fcsl_histogram_t *histogram);

#endif /* FCSL_HISTOGRAM_JSON_H */
