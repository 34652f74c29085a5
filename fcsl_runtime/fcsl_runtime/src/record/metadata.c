/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes metadata.yaml of a bag.
 */
#define _GNU_SOURCE
#include "metadata.h"

#include <errno.h>
#include <inttypes.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

enum { PATH_BYTES = 4096 };

/* rosbag2's word for "no message yet". */
#define NO_TIME INT64_MAX

/* A YAML single-quoted scalar: the only special character is the quote itself. */
static void put_quoted(FILE *out, const char *text)
{
    (void)fputc('\'', out);
    for (; *text != '\0'; text++) {
        if (*text == '\'') {
            (void)fputc('\'', out);
        }
        (void)fputc(*text, out);
    }
    (void)fputc('\'', out);
}

static void put_topic(FILE *out, const fcsl_metadata_topic_t *topic)
{
    (void)fprintf(out, "    - topic_metadata:\n        name: %s\n        type: %s\n", topic->name, topic->type);
    (void)fprintf(out, "        serialization_format: cdr\n        offered_qos_profiles:%s",
                  topic->transient_local ? "\n" FCSL_QOS_PROFILE("          ", "transient_local") : " []\n");
    (void)fprintf(out, "        type_description_hash: '%s'\n      message_count: %" PRIu64 "\n", topic->type_hash,
                  topic->message_count);
}

static void put_metadata(FILE *out, const fcsl_metadata_t *metadata)
{
    const int empty = metadata->message_count == 0;
    const int64_t start = empty ? NO_TIME : (int64_t)metadata->first_ns;
    const int64_t duration = empty ? 0 : (int64_t)(metadata->last_ns - metadata->first_ns);
    (void)fprintf(out, "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n");
    (void)fprintf(out, "  duration:\n    nanoseconds: %" PRId64 "\n", duration);
    (void)fprintf(out, "  starting_time:\n    nanoseconds_since_epoch: %" PRId64 "\n", start);
    (void)fprintf(out, "  message_count: %" PRIu64 "\n  topics_with_message_count:%s", metadata->message_count,
                  metadata->topic_count == 0 ? " []\n" : "\n");
    for (uint32_t i = 0; i < metadata->topic_count; i++) {
        put_topic(out, &metadata->topics[i]);
    }
    (void)fprintf(out, "  compression_format: ''\n  compression_mode: ''\n  relative_file_paths:\n    - ");
    put_quoted(out, metadata->file);
    (void)fprintf(out, "\n  files:\n    - path: ");
    put_quoted(out, metadata->file);
    (void)fprintf(out, "\n      starting_time:\n        nanoseconds_since_epoch: %" PRId64 "\n", start);
    (void)fprintf(out, "      duration:\n        nanoseconds: %" PRId64 "\n      message_count: %" PRIu64 "\n",
                  duration, metadata->message_count);
    (void)fprintf(out, "  custom_data: ~\n  ros_distro: jazzy\n");
}

int fcsl_metadata_write(const char *folder, const fcsl_metadata_t *metadata, fcsl_error_t *error)
{
    char path[PATH_BYTES];
    char temporary[PATH_BYTES];
    const int length = snprintf(path, sizeof path, "%s/metadata.yaml", folder);
    const int temporary_length = snprintf(temporary, sizeof temporary, "%s/.metadata.yaml.tmp", folder);
    if (length >= (int)sizeof path || temporary_length >= (int)sizeof temporary) {
        return fcsl_fail(error, "the bag's path is too long");
    }
    FILE *out = fopen(temporary, "we");
    if (out == NULL) {
        return fcsl_fail(error, "cannot write '%s': %s", temporary, strerror(errno));
    }
    put_metadata(out, metadata);
    int failed = ferror(out) != 0 || fflush(out) != 0 || fsync(fileno(out)) != 0;
    failed = fclose(out) != 0 || failed;
    if (failed || rename(temporary, path) != 0) {
        const int code = errno;
        (void)unlink(temporary);
        return fcsl_fail(error, "cannot write '%s': %s", path, strerror(code));
    }
    return 0;
}
