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

int fcsl_metadata_file_name(const fcsl_metadata_t *metadata, const fcsl_metadata_file_t *file,
                            char name[FCSL_FILE_NAME_BYTES])
{
    const int length = snprintf(name, FCSL_FILE_NAME_BYTES, "%.480s_%" PRIu32 ".mcap", metadata->stem, file->number);
    return length > 0 && length < FCSL_FILE_NAME_BYTES ? 0 : -1;
}

static void put_start(FILE *out, const char *indent, uint64_t first_ns)
{
    (void)fprintf(out, "%sstarting_time:\n%s  nanoseconds_since_epoch: %" PRId64 "\n", indent, indent,
                  (int64_t)first_ns);
}

static void put_duration(FILE *out, const char *indent, uint64_t first_ns, uint64_t last_ns)
{
    (void)fprintf(out, "%sduration:\n%s  nanoseconds: %" PRId64 "\n", indent, indent, (int64_t)(last_ns - first_ns));
}

/* Of all files. One without messages is as long as its begin. */
static void put_whole(FILE *out, const fcsl_metadata_t *metadata)
{
    uint64_t first_ns = metadata->files[0].first_ns;
    uint64_t last_ns = metadata->files[0].last_ns;
    uint64_t count = 0;
    for (uint32_t i = 0; i < metadata->file_count; i++) {
        const fcsl_metadata_file_t *file = &metadata->files[i];
        count += file->message_count;
        first_ns = file->first_ns < first_ns ? file->first_ns : first_ns;
        last_ns = file->last_ns > last_ns ? file->last_ns : last_ns;
    }
    put_duration(out, "  ", first_ns, last_ns);
    put_start(out, "  ", first_ns);
    (void)fprintf(out, "  message_count: %" PRIu64 "\n", count);
}

static void put_files(FILE *out, const fcsl_metadata_t *metadata)
{
    char name[FCSL_FILE_NAME_BYTES] = "";
    (void)fprintf(out, "  relative_file_paths:\n");
    for (uint32_t i = 0; i < metadata->file_count; i++) {
        (void)fcsl_metadata_file_name(metadata, &metadata->files[i], name);
        (void)fprintf(out, "    - ");
        put_quoted(out, name);
        (void)fputc('\n', out);
    }
    (void)fprintf(out, "  files:\n");
    for (uint32_t i = 0; i < metadata->file_count; i++) {
        const fcsl_metadata_file_t *file = &metadata->files[i];
        (void)fcsl_metadata_file_name(metadata, file, name);
        (void)fprintf(out, "    - path: ");
        put_quoted(out, name);
        (void)fputc('\n', out);
        put_start(out, "      ", file->first_ns);
        put_duration(out, "      ", file->first_ns, file->last_ns);
        (void)fprintf(out, "      message_count: %" PRIu64 "\n", file->message_count);
    }
}

static void put_metadata(FILE *out, const fcsl_metadata_t *metadata)
{
    (void)fprintf(out, "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n");
    put_whole(out, metadata);
    (void)fprintf(out, "  topics_with_message_count:%s", metadata->topic_count == 0 ? " []\n" : "\n");
    for (uint32_t i = 0; i < metadata->topic_count; i++) {
        put_topic(out, &metadata->topics[i]);
    }
    (void)fprintf(out, "  compression_format: ''\n  compression_mode: ''\n");
    put_files(out, metadata);
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
