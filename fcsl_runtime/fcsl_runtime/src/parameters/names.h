/* SPDX-License-Identifier: Apache-2.0
 *
 * Names of parameter files: of nodes, and of parameters as ROS 2 has them (`pilot.targets.0.mass`).
 */
#ifndef FCSL_PARAMETER_NAMES_H
#define FCSL_PARAMETER_NAMES_H

#include <stddef.h>

#include "fcsl/fcsl_machine.h"

enum { PARAMETER_NAME_BYTES = 256 };

/* Whether a section for `pattern` is one for `node` ("/quad1/lander"): `*` stands for one name of a path, `**` for any number. */
int fcsl_node_matches(const char *pattern, const char *node);
/* The name of a parameter's field: its path without `parameters`, indices behind dots. */
void fcsl_parameter_name(const fcsl_machine_t *machine, const fcsl_field_t *field, char name[PARAMETER_NAME_BYTES]);
/* The parameter of this name: an index into fields, or FCSL_NONE. */
int32_t fcsl_parameter_find(const fcsl_machine_t *machine, const char *name);
/* A name that is none of the machine's: 1 when it is the node's own (`use_sim_time`); 0 when it was meant for the machine, with
 * the nearest name in `nearest`, or "". */
int fcsl_parameter_is_foreign(const fcsl_machine_t *machine, const char *name, char nearest[PARAMETER_NAME_BYTES]);

#endif /* FCSL_PARAMETER_NAMES_H */
