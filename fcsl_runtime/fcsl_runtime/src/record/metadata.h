/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_METADATA_H
#define FCSL_METADATA_H

#include "base/error.h"

typedef struct {
    const char *name;
    const char *type;
    const char *type_hash; /* "RIHS01_..." */
    int transient_local;
    uint64_t message_count;
} fcsl_metadata_topic_t;

typedef struct {
    const char *file; /* name of the MCAP file inside the folder */
    uint64_t first_ns;
    uint64_t last_ns; /* both ignored without messages */
    uint64_t message_count;
    const fcsl_metadata_topic_t *topics;
    uint32_t topic_count;
} fcsl_metadata_t;

/* Writes <folder>/metadata.yaml by way of a temporary file, as `ros2 bag` of Jazzy would (version 9). */
int fcsl_metadata_write(const char *folder, const fcsl_metadata_t *metadata, fcsl_error_t *error);

#define FCSL_QOS_PROFILE(indent, durability)                                                                           \
    indent "- history: keep_last\n" indent "  depth: 1\n" indent "  reliability: reliable\n" indent                    \
           "  durability: " durability "\n" indent "  deadline:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent \
           "  lifespan:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent "  liveliness: automatic\n" indent      \
           "  liveliness_lease_duration:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent                        \
           "  avoid_ros_namespace_conventions: false\n"

#endif /* FCSL_METADATA_H */
