/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_TYPE_HASH_H
#define FCSL_TYPE_HASH_H

enum { FCSL_TYPE_HASH_BYTES = 72 };

/* The ROS 2 type hash (REP 2016, "RIHS01_" and 64 hex digits) of the interface `type` ("pkg/msg/Name") defined by the
 * complete ros2msg text `schema`. Returns 0, or -1 (and an empty text) when the definition is not understood. */
int fcsl_type_hash(const char *type, const char *schema, char hash[FCSL_TYPE_HASH_BYTES]);

#endif /* FCSL_TYPE_HASH_H */
