/* SPDX-License-Identifier: Apache-2.0
 *
 * A bag on disk in ROS 2 Jazzy's own layout: a folder with metadata.yaml (version 9) and one MCAP file. metadata.yaml is
 * there from the beginning, so that a bag of a killed process can be found, and is replaced atomically at the end.
 */
#ifndef FCSL_BAG_H
#define FCSL_BAG_H

#include "base/error.h"

enum { FCSL_BAG_TOPICS_MAX = 4096 };

typedef struct fcsl_bag fcsl_bag_t;

/* Creates the folder, which must not exist. */
fcsl_bag_t *fcsl_bag_open(const char *path, fcsl_error_t *error);
/* `schema` is complete ros2msg text. Returns the topic's number, or -1. */
int fcsl_bag_add_topic(fcsl_bag_t *bag, const char *topic, const char *type, const char *schema, int transient_local,
                       fcsl_error_t *error);
/* Writes metadata.yaml with the counts so far. */
int fcsl_bag_write_metadata(fcsl_bag_t *bag, fcsl_error_t *error);
/* Keeps other threads from adding topics meanwhile: between these two calls messages may be written. */
void fcsl_bag_lock(fcsl_bag_t *bag);
void fcsl_bag_unlock(fcsl_bag_t *bag);
/* log_time = publish_time = time_ns. */
int fcsl_bag_write(fcsl_bag_t *bag, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                   fcsl_error_t *error);
/* Hands what was written to the operating system, so that it outlives a killed process. */
int fcsl_bag_flush(fcsl_bag_t *bag, fcsl_error_t *error);
/* Finishes the MCAP file and metadata.yaml; frees in any case. */
int fcsl_bag_close(fcsl_bag_t *bag, fcsl_error_t *error);
/* Closes and removes what was created: for a recording that could not start. */
void fcsl_bag_abandon(fcsl_bag_t *bag);

#endif /* FCSL_BAG_H */
