/* SPDX-License-Identifier: Apache-2.0
 *
 * A bag on disk in ROS 2 Jazzy's own layout: a folder with metadata.yaml (version 9) and MCAP files, <folder>_0.mcap and so
 * on. The folder takes its name when it holds metadata.yaml and the first. metadata.yaml is replaced atomically as the bag grows, so that a bag of a killed process can be
 * played.
 */
#ifndef FCSL_BAG_H
#define FCSL_BAG_H

#include <stdint.h>

#include "fcsl/fcsl_run.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { FCSL_BAG_TOPICS_MAX = 4096, FCSL_BAG_FILES_MAX = 1000 };

typedef struct fcsl_bag fcsl_bag_t;

/* Creates the folder, which must not exist, under a name of its own. The first message will be of `start_ns`. */
fcsl_bag_t *fcsl_bag_open(const char *path, uint64_t start_ns, fcsl_error_t *error);
/* Writes metadata.yaml and gives the folder its name. */
int fcsl_bag_publish(fcsl_bag_t *bag, fcsl_error_t *error);
/* `schema` is complete ros2msg text. Returns the topic's number, or -1. */
int fcsl_bag_add_topic(fcsl_bag_t *bag, const char *topic, const char *type, const char *schema, int transient_local,
                       fcsl_error_t *error);
/* Writes metadata.yaml with the counts so far; does not wait for the disk. */
int fcsl_bag_write_metadata(fcsl_bag_t *bag, fcsl_error_t *error);
/* Keeps other threads from adding topics meanwhile: between these two calls messages may be written. */
void fcsl_bag_lock(fcsl_bag_t *bag);
void fcsl_bag_unlock(fcsl_bag_t *bag);
/* log_time = publish_time = time_ns. */
int fcsl_bag_write(fcsl_bag_t *bag, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                   fcsl_error_t *error);
/* Hands what was written to the operating system, so that it outlives a killed process. */
int fcsl_bag_flush(fcsl_bag_t *bag, fcsl_error_t *error);
/* The bytes of the present file that the operating system has, and the time since its first message. */
uint64_t fcsl_bag_file_bytes(const fcsl_bag_t *bag);
uint64_t fcsl_bag_file_ns(const fcsl_bag_t *bag, uint64_t now_ns);
/* Finishes the present file and begins another one, with all topics, for messages from `time_ns` on. Does not wait for the disk.
 * A bag of FCSL_BAG_FILES_MAX files goes on with its last. Between fcsl_bag_lock and fcsl_bag_unlock, as the next two. */
int fcsl_bag_split(fcsl_bag_t *bag, uint64_t time_ns, fcsl_error_t *error);
/* Marks the files that have messages of `from_ns` or later, the present one included, so that fcsl_bag_remove leaves them. */
void fcsl_bag_keep(fcsl_bag_t *bag, uint64_t from_ns);
/* Removes finished files: those that end before `before_ns` and are not marked, and the first ones beyond the last `most` (0: no
 * limit). metadata.yaml loses them first. */
int fcsl_bag_remove(fcsl_bag_t *bag, uint64_t before_ns, uint32_t most, fcsl_error_t *error);
/* Finishes the MCAP file and metadata.yaml; frees in any case. */
int fcsl_bag_close(fcsl_bag_t *bag, fcsl_error_t *error);
/* Closes and removes what was created: for a recording that could not start. */
void fcsl_bag_abandon(fcsl_bag_t *bag);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_BAG_H */
