/* SPDX-License-Identifier: Apache-2.0 */
#ifndef FCSL_METADATA_H
#define FCSL_METADATA_H

#include <stdint.h>

#include "fcsl/fcsl_error.h"

typedef struct {
    const char *name;
    const char *type;
    const char *type_hash; /* "RIHS01_..." */
    int transient_local;
    uint64_t message_count;
} fcsl_metadata_topic_t;

/* One MCAP file inside the folder: STEM_NUMBER.mcap. */
typedef struct {
    uint32_t number;
    uint64_t first_ns;
    uint64_t last_ns; /* without messages: both the time at which the file begins */
    uint64_t message_count;
    uint64_t *topic_counts; /* of a file that is finished: messages of each topic */
    uint32_t topic_count;
    int is_kept; /* it has something around a trigger */
} fcsl_metadata_file_t;

enum { FCSL_FILE_NAME_BYTES = 512 };

typedef struct {
    char stem[FCSL_FILE_NAME_BYTES];
    fcsl_metadata_file_t *files; /* in order of time, one at least */
    uint32_t file_count;
    const fcsl_metadata_topic_t *topics;
    uint32_t topic_count;
} fcsl_metadata_t;

/* The name of a file inside the folder; -1: too long. */
int fcsl_metadata_file_name(const fcsl_metadata_t *metadata, const fcsl_metadata_file_t *file,
                            char name[FCSL_FILE_NAME_BYTES]);

/* Replaces <folder>/metadata.yaml, atomically, by what `ros2 bag` of Jazzy would write (version 9). `durable`: waits until
 * the disk has it; otherwise it outlives a killed process, but perhaps not a power failure. */
int fcsl_metadata_write(const char *folder, const fcsl_metadata_t *metadata, int durable, fcsl_error_t *error);
/* Removes the file, and what a killed process left of it. */
void fcsl_metadata_remove(const char *folder);

/* What the ROS 2 nodes of FCSL offer on the same topics. */
#define FCSL_QOS_PROFILE(indent, depth, durability)                                                                    \
    indent "- history: keep_last\n" indent "  depth: " depth "\n" indent "  reliability: reliable\n" indent            \
           "  durability: " durability "\n" indent "  deadline:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent \
           "  lifespan:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent "  liveliness: automatic\n" indent      \
           "  liveliness_lease_duration:\n" indent "    sec: 0\n" indent "    nsec: 0\n" indent                        \
           "  avoid_ros_namespace_conventions: false\n"
#define FCSL_QOS(indent, transient_local)                                                                              \
    ((transient_local) ? FCSL_QOS_PROFILE(indent, "1", "transient_local")                                              \
                       : FCSL_QOS_PROFILE(indent, "2000", "volatile"))

#endif /* FCSL_METADATA_H */
