/* SPDX-License-Identifier: Apache-2.0
 *
 * A message made at run time of fields of a machine that have no interface of their own: their names, types, units and docs
 * are those of the field table, structs in it become messages within the message.
 */
#ifndef FCSL_FIELD_MESSAGE_H
#define FCSL_FIELD_MESSAGE_H

#include "message.h"

/* `leaves`: fields of one instance and role (or channels), the members of a struct one behind the other: what stands behind the role in their
 * paths becomes the name. Fills *schema (complete ros2msg text, to be freed) and `layout`; 0, or -1. */
int fcsl_field_message_build(const fcsl_machine_t *machine, const fcsl_field_t *const *leaves, uint32_t count,
                             const char *type, char **schema, fcsl_layout_t *layout, fcsl_error_t *error);

#endif /* FCSL_FIELD_MESSAGE_H */
