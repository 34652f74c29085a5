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
    (void)fprintf(out, "        serialization_format: cdr\n        offered_qos_profiles:\n%s",
                  FCSL_QOS("          ", topic->transient_local));
    (void)fprintf(out, "        type_description_hash: '%s'\n      message_count: %" PRIu64 "\n", topic->type_hash,
                  topic->message_count);
}

static void put_metadata(FILE *out, const fcsl_metadata_t *metadata)
{
    const int64_t start = (int64_t)metadata->first_ns;
    const int64_t duration = (int64_t)(metadata->last_ns - metadata->first_ns);
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

/* Paths of the file and of the one that takes its place. */
static int name_files(const char *folder, char path[PATH_BYTES], char temporary[PATH_BYTES])
{
    const int length = snprintf(path, PATH_BYTES, "%s/metadata.yaml", folder);
    const int temporary_length = snprintf(temporary, PATH_BYTES, "%s/.metadata.yaml.tmp", folder);
    return length < PATH_BYTES && temporary_length < PATH_BYTES ? 0 : -1;
}

void fcsl_metadata_remove(const char *folder)
{
    char path[PATH_BYTES];
    char temporary[PATH_BYTES];
    if (name_files(folder, path, temporary) == 0) {
        (void)unlink(path);
        (void)unlink(temporary);
    }
}

int fcsl_metadata_write(const char *folder, const fcsl_metadata_t *metadata, int durable, fcsl_error_t *error)
{
    char path[PATH_BYTES];
    char temporary[PATH_BYTES];
    if (name_files(folder, path, temporary) != 0) {
        return fcsl_fail(error, "the bag's path is too long");
    }
    FILE *out = fopen(temporary, "we");
    if (out == NULL) {
        return fcsl_fail(error, "cannot write '%s': %s", temporary, strerror(errno));
    }
    put_metadata(out, metadata);
    int failed = ferror(out) != 0 || fflush(out) != 0 || (durable && fsync(fileno(out)) != 0);
    failed = fclose(out) != 0 || failed;
    if (failed || rename(temporary, path) != 0) {
        const int code = errno;
        (void)unlink(temporary);
        return fcsl_fail(error, "cannot write '%s': %s", path, strerror(code));
    }
    return 0;
}
