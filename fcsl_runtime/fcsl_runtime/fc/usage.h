/* SPDX-License-Identifier: Apache-2.0
 *
 * What the command lines of fcsl-fc and fcsl-guard share: errors, numbers, and the one argument that is no option.
 */
#ifndef FC_USAGE_H
#define FC_USAGE_H

#include <stdint.h>

/* Prints both texts on standard error, behind the program's name, and where help is. Returns -1. */
int usage_error(const char *what, const char *which);

/* Reads an integer of [min, max], without a sign; `max` INT64_MAX: of any size. Returns 0; -1 after an error about --`name`. */
int usage_number(const char *name, const char *text, uint64_t min, uint64_t max, uint64_t *value);

/* Reads seconds with at most three decimals as ms of [min_ms, max_ms]. Returns 0; -1 after an error about --`name`. */
int usage_seconds(const char *name, const char *text, uint64_t min_ms, uint64_t max_ms, uint64_t *value_ms);

/* Reads what getopt_long has left, the path of the machine library. Returns 0; -1 after an error. */
int usage_library(int argc, char **argv, const char **library);

#endif /* FC_USAGE_H */
