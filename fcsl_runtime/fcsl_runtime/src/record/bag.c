/* SPDX-License-Identifier: Apache-2.0
 *
 * A bag on disk: the folder, metadata.yaml and the MCAP file.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_bag.h"

#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "fcsl/fcsl_error.h"
#include "metadata.h"
#include "messages/type_hash.h"

enum { PATH_BYTES = 4096, NAME_BYTES = FCSL_FILE_NAME_BYTES, REASON_BYTES = 256, NUMBER_BYTES = 32 };

typedef struct {
    uint16_t channel;
    uint32_t sequence;
    char type_hash[FCSL_TYPE_HASH_BYTES];
} channel_t;

struct fcsl_bag {
    char name[PATH_BYTES];   /* the folder's, once it is published */
    char folder[PATH_BYTES]; /* where it is now */
    fcsl_mcap_t *mcap;
    pthread_mutex_t lock; /* topics are added by one thread while another one writes */
    fcsl_metadata_t metadata;
    fcsl_metadata_topic_t *topics;
    channel_t *channels;
    char **schemas; /* of the topics, for the next file */
};

/* The folder's path without trailing slashes, the file names that ros2 bag would choose, <folder>_0.mcap, and where the folder is
 * made: beside its place, under a name that no other process uses. */
static int name_files(fcsl_bag_t *bag, const char *path, fcsl_error_t *error)
{
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') {
        length--;
    }
    if (length == 0 || length + NAME_BYTES >= sizeof bag->name) {
        return fcsl_fail(error, "bag path '%.64s' is %s", path, length == 0 ? "empty" : "too long");
    }
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)path[i] < 0x20) {
            return fcsl_fail(error, "a bag's path must not contain control characters");
        }
    }
    memcpy(bag->name, path, length);
    const char *slash = strrchr(bag->name, '/');
    const char *last = slash != NULL ? slash + 1 : bag->name;
    const int written = snprintf(bag->metadata.stem, sizeof bag->metadata.stem - NUMBER_BYTES, "%s", last);
    const int made = snprintf(bag->folder, sizeof bag->folder, "%.*s.%s.%ld.tmp", (int)(last - bag->name), bag->name,
                              last, (long)getpid());
    return written < (int)(sizeof bag->metadata.stem - NUMBER_BYTES) && made < (int)sizeof bag->folder
               ? 0
               : fcsl_fail(error, "the bag's name is too long");
}

static void free_bag(fcsl_bag_t *bag)
{
    for (uint32_t i = 0; i < bag->metadata.topic_count; i++) {
        free((char *)bag->topics[i].name);
        free((char *)bag->topics[i].type);
        free(bag->schemas[i]);
    }
    for (uint32_t i = 0; i < bag->metadata.file_count; i++) {
        free(bag->metadata.files[i].topic_counts);
    }
    free(bag->metadata.files);
    free(bag->topics);
    free(bag->channels);
    free((void *)bag->schemas);
    free(bag);
}

static fcsl_metadata_file_t *present_file(const fcsl_bag_t *bag)
{
    return &bag->metadata.files[bag->metadata.file_count - 1u];
}

/* Where a file is: `suffix` behind its name. */
static void file_path(const fcsl_bag_t *bag, const fcsl_metadata_file_t *file, const char *suffix,
                      char path[PATH_BYTES + NAME_BYTES + 8])
{
    char name[FCSL_FILE_NAME_BYTES] = "";
    (void)fcsl_metadata_file_name(&bag->metadata, file, name);
    (void)snprintf(path, PATH_BYTES + NAME_BYTES + 8, "%s/%s%s", bag->folder, name, suffix);
}

static void remove_folder(const fcsl_bag_t *bag)
{
    char path[PATH_BYTES + NAME_BYTES + 8];
    file_path(bag, present_file(bag), ".tmp", path);
    (void)unlink(path);
    file_path(bag, present_file(bag), "", path);
    (void)unlink(path);
    fcsl_metadata_remove(bag->folder);
    (void)rmdir(bag->folder);
}

static int fail_existing(const fcsl_bag_t *bag, fcsl_error_t *error)
{
    return fcsl_fail(error, "bag '%s' exists already", bag->name);
}

static int open_file(const fcsl_bag_t *bag, const fcsl_metadata_file_t *file, fcsl_mcap_t **mcap, fcsl_error_t *error)
{
    char path[PATH_BYTES + NAME_BYTES + 8];
    char reason[REASON_BYTES] = "";
    file_path(bag, file, "", path);
    return fcsl_mcap_open(path, mcap, reason, sizeof reason) == 0
               ? 0
               : fcsl_fail(error, "cannot create '%s%s': %s", bag->name, path + strlen(bag->folder), reason);
}

static int create_files(fcsl_bag_t *bag, fcsl_error_t *error)
{
    struct stat there;
    if (lstat(bag->name, &there) == 0) {
        return fail_existing(bag, error);
    }
    remove_folder(bag); /* of a process with the same number that was killed */
    if (mkdir(bag->folder, 0777) != 0) {
        return fcsl_fail(error, "cannot create bag '%s': %s", bag->name, strerror(errno));
    }
    if (open_file(bag, present_file(bag), &bag->mcap, error) != 0) {
        remove_folder(bag);
        return -1;
    }
    return 0;
}

fcsl_bag_t *fcsl_bag_open(const char *path, uint64_t start_ns, fcsl_error_t *error)
{
    fcsl_bag_t *bag = calloc(1, sizeof *bag);
    if (bag == NULL) {
        (void)fcsl_fail(error, "out of memory for the bag");
        return NULL;
    }
    bag->topics = calloc(FCSL_BAG_TOPICS_MAX, sizeof *bag->topics);
    bag->channels = calloc(FCSL_BAG_TOPICS_MAX, sizeof *bag->channels);
    bag->schemas = calloc(FCSL_BAG_TOPICS_MAX, sizeof *bag->schemas);
    bag->metadata.files = calloc(FCSL_BAG_FILES_MAX, sizeof *bag->metadata.files);
    if (bag->topics == NULL || bag->channels == NULL || bag->schemas == NULL || bag->metadata.files == NULL ||
        pthread_mutex_init(&bag->lock, NULL) != 0) {
        (void)fcsl_fail(error, "out of memory for the bag");
        free_bag(bag);
        return NULL;
    }
    bag->metadata.files[0] = (fcsl_metadata_file_t){.first_ns = start_ns, .last_ns = start_ns};
    bag->metadata.file_count = 1;
    bag->metadata.topics = bag->topics;
    if (name_files(bag, path, error) != 0 || create_files(bag, error) != 0) {
        (void)pthread_mutex_destroy(&bag->lock);
        free_bag(bag);
        return NULL;
    }
    return bag;
}

/* Declares a topic in a file. */
static int define(fcsl_bag_t *bag, uint32_t index, fcsl_mcap_t *mcap, fcsl_error_t *error)
{
    const fcsl_metadata_topic_t *topic = &bag->topics[index];
    const char *schema = bag->schemas[index];
    const int64_t schema_id = fcsl_mcap_add_schema(mcap, topic->type, "ros2msg", schema, strlen(schema));
    const char *keys[] = {"offered_qos_profiles", "topic_type_hash"};
    const char *values[] = {FCSL_QOS("", topic->transient_local), topic->type_hash};
    const int64_t channel =
        schema_id < 0 ? -1 : fcsl_mcap_add_channel(mcap, topic->name, (uint16_t)schema_id, "cdr", keys, values, 2);
    if (channel < 0) {
        return fcsl_fail(error, "cannot add topic '%s' to the bag: %s", topic->name, fcsl_mcap_error(mcap));
    }
    bag->channels[index].channel = (uint16_t)channel;
    return 0;
}

static int add_locked(fcsl_bag_t *bag, const char *topic, const char *type, const char *schema, int transient_local,
                      fcsl_error_t *error)
{
    const uint32_t index = bag->metadata.topic_count;
    if (index == FCSL_BAG_TOPICS_MAX) {
        return fcsl_fail(error, "a bag holds at most %d topics", FCSL_BAG_TOPICS_MAX);
    }
    for (uint32_t i = 0; i < index; i++) {
        if (strcmp(bag->topics[i].name, topic) == 0) {
            return fcsl_fail(error, "topic '%s' is in the bag already", topic);
        }
    }
    char *type_hash = bag->channels[index].type_hash;
    if (fcsl_type_hash(type, schema, type_hash) != 0) {
        return fcsl_fail(error, "topic '%.100s': the definition of '%.100s' is not understood", topic, type);
    }
    fcsl_metadata_topic_t *entry = &bag->topics[index];
    *entry = (fcsl_metadata_topic_t){
        .name = strdup(topic), .type = strdup(type), .type_hash = type_hash, .transient_local = transient_local};
    bag->schemas[index] = strdup(schema);
    if (entry->name == NULL || entry->type == NULL || bag->schemas[index] == NULL) {
        (void)fcsl_fail(error, "out of memory for the bag");
    } else if (define(bag, index, bag->mcap, error) == 0) {
        bag->metadata.topic_count = index + 1u;
        return (int)index;
    }
    free((char *)entry->name);
    free((char *)entry->type);
    free(bag->schemas[index]);
    return -1;
}

int fcsl_bag_add_topic(fcsl_bag_t *bag, const char *topic, const char *type, const char *schema, int transient_local,
                       fcsl_error_t *error)
{
    (void)pthread_mutex_lock(&bag->lock);
    const int index = add_locked(bag, topic, type, schema, transient_local, error);
    (void)pthread_mutex_unlock(&bag->lock);
    return index;
}

static int write_metadata(fcsl_bag_t *bag, int durable, fcsl_error_t *error)
{
    (void)pthread_mutex_lock(&bag->lock);
    const int status = fcsl_metadata_write(bag->folder, &bag->metadata, durable, error);
    (void)pthread_mutex_unlock(&bag->lock);
    return status;
}

int fcsl_bag_write_metadata(fcsl_bag_t *bag, fcsl_error_t *error)
{
    return write_metadata(bag, 0, error);
}

int fcsl_bag_publish(fcsl_bag_t *bag, fcsl_error_t *error)
{
    if (write_metadata(bag, 0, error) != 0) {
        return -1;
    }
    int failed = renameat2(AT_FDCWD, bag->folder, AT_FDCWD, bag->name, RENAME_NOREPLACE);
    if (failed != 0 && errno == EINVAL) { /* this file system cannot: rename() replaces nothing but an empty folder */
        failed = rename(bag->folder, bag->name);
    }
    if (failed != 0) {
        return errno == EEXIST || errno == ENOTEMPTY
                   ? fail_existing(bag, error)
                   : fcsl_fail(error, "cannot create bag '%s': %s", bag->name, strerror(errno));
    }
    memcpy(bag->folder, bag->name, sizeof bag->folder);
    return 0;
}

static int fail_writing(const fcsl_bag_t *bag, fcsl_error_t *error)
{
    return fcsl_fail(error, "cannot write to bag '%.200s': %s", bag->name, fcsl_mcap_error(bag->mcap));
}

void fcsl_bag_lock(fcsl_bag_t *bag)
{
    (void)pthread_mutex_lock(&bag->lock);
}

void fcsl_bag_unlock(fcsl_bag_t *bag)
{
    (void)pthread_mutex_unlock(&bag->lock);
}

int fcsl_bag_write(fcsl_bag_t *bag, uint32_t topic, uint64_t time_ns, const uint8_t *cdr, uint32_t size,
                   fcsl_error_t *error)
{
    channel_t *channel = &bag->channels[topic];
    if (fcsl_mcap_write(bag->mcap, channel->channel, channel->sequence, time_ns, time_ns, cdr, size) != 0) {
        return fail_writing(bag, error);
    }
    fcsl_metadata_file_t *file = present_file(bag);
    if (file->message_count == 0 || time_ns < file->first_ns) {
        file->first_ns = time_ns;
    }
    if (file->message_count == 0 || time_ns > file->last_ns) {
        file->last_ns = time_ns;
    }
    file->message_count++;
    bag->topics[topic].message_count++;
    channel->sequence++;
    return 0;
}

int fcsl_bag_flush(fcsl_bag_t *bag, fcsl_error_t *error)
{
    (void)pthread_mutex_lock(&bag->lock);
    const int result = fcsl_mcap_flush(bag->mcap) == 0 ? 0 : fail_writing(bag, error);
    (void)pthread_mutex_unlock(&bag->lock);
    return result;
}

uint64_t fcsl_bag_file_bytes(const fcsl_bag_t *bag)
{
    char path[PATH_BYTES + NAME_BYTES + 8];
    struct stat now;
    file_path(bag, present_file(bag), "", path);
    return stat(path, &now) == 0 ? (uint64_t)now.st_size : 0u;
}

uint64_t fcsl_bag_file_ns(const fcsl_bag_t *bag, uint64_t now_ns)
{
    const uint64_t first_ns = present_file(bag)->first_ns;
    return now_ns > first_ns ? now_ns - first_ns : 0u;
}

/* How many messages of each topic the present file has: those of all files, without those of the others. */
static int count_topics(fcsl_bag_t *bag, fcsl_error_t *error)
{
    fcsl_metadata_t *metadata = &bag->metadata;
    fcsl_metadata_file_t *file = present_file(bag);
    file->topic_counts = calloc(metadata->topic_count + 1u, sizeof *file->topic_counts);
    if (file->topic_counts == NULL) {
        return fcsl_fail(error, "out of memory for the bag");
    }
    file->topic_count = metadata->topic_count;
    for (uint32_t i = 0; i < metadata->topic_count; i++) {
        file->topic_counts[i] = bag->topics[i].message_count;
        for (uint32_t j = 0; j + 1u < metadata->file_count; j++) {
            const fcsl_metadata_file_t *other = &metadata->files[j];
            file->topic_counts[i] -= i < other->topic_count ? other->topic_counts[i] : 0u;
        }
    }
    return 0;
}

/* metadata.yaml lists the next file before that has anything, and the present one ends when the next is there: a process that is
 * killed anywhere here leaves a bag that has all of both. */
int fcsl_bag_split(fcsl_bag_t *bag, uint64_t time_ns, fcsl_error_t *error)
{
    fcsl_metadata_t *metadata = &bag->metadata;
    if (metadata->file_count == FCSL_BAG_FILES_MAX) {
        return 0;
    }
    if (fcsl_mcap_flush(bag->mcap) != 0) {
        return fail_writing(bag, error);
    }
    fcsl_metadata_file_t *next = &metadata->files[metadata->file_count];
    *next = (fcsl_metadata_file_t){.number = present_file(bag)->number + 1u, .first_ns = time_ns, .last_ns = time_ns};
    fcsl_mcap_t *mcap = NULL;
    if (count_topics(bag, error) != 0 || open_file(bag, next, &mcap, error) != 0) {
        return -1;
    }
    int failed = 0;
    for (uint32_t i = 0; i < metadata->topic_count && failed == 0; i++) {
        failed = define(bag, i, mcap, error);
    }
    char reason[REASON_BYTES] = "";
    fcsl_mcap_t *finished = bag->mcap;
    bag->mcap = mcap;
    metadata->file_count++;
    failed = failed != 0 || fcsl_metadata_write(bag->folder, metadata, 0, error) != 0;
    if (fcsl_mcap_end(finished, reason, sizeof reason) != 0) {
        return fcsl_fail(error, "cannot finish a file of bag '%.200s': %s", bag->name, reason);
    }
    return failed ? -1 : 0;
}

void fcsl_bag_keep(fcsl_bag_t *bag, uint64_t from_ns)
{
    for (uint32_t i = 0; i < bag->metadata.file_count; i++) {
        fcsl_metadata_file_t *file = &bag->metadata.files[i];
        file->is_kept = file->is_kept || file->last_ns >= from_ns;
    }
    present_file(bag)->is_kept = 1;
}

int fcsl_bag_remove(fcsl_bag_t *bag, uint64_t before_ns, uint32_t most, fcsl_error_t *error)
{
    fcsl_metadata_t *metadata = &bag->metadata;
    fcsl_metadata_t removed = *metadata;
    uint32_t left = 0;
    removed.files = calloc(metadata->file_count, sizeof *removed.files);
    if (removed.files == NULL) {
        return fcsl_fail(error, "out of memory for the bag");
    }
    removed.file_count = 0;
    for (uint32_t i = 0; i < metadata->file_count; i++) {
        const fcsl_metadata_file_t file = metadata->files[i];
        const int is_present = i + 1u == metadata->file_count;
        const int is_surplus = most != 0 && metadata->file_count - i > most;
        if (is_present || !(is_surplus || (!file.is_kept && file.last_ns < before_ns))) {
            metadata->files[left++] = file;
            continue;
        }
        removed.files[removed.file_count++] = file;
        for (uint32_t j = 0; j < file.topic_count; j++) {
            bag->topics[j].message_count -= file.topic_counts[j];
        }
    }
    metadata->file_count = left;
    const int status = removed.file_count > 0 ? fcsl_metadata_write(bag->folder, metadata, 0, error) : 0;
    char path[PATH_BYTES + NAME_BYTES + 8];
    for (uint32_t i = 0; i < removed.file_count; i++) {
        file_path(bag, &removed.files[i], "", path);
        (void)unlink(path);
        free(removed.files[i].topic_counts);
    }
    free(removed.files);
    return status;
}

/* Waits until the disk has the files that ended without waiting for it. */
static int sync_files(const fcsl_bag_t *bag, fcsl_error_t *error)
{
    char path[PATH_BYTES + NAME_BYTES + 8];
    for (uint32_t i = 0; i + 1u < bag->metadata.file_count; i++) {
        file_path(bag, &bag->metadata.files[i], "", path);
        const int file = open(path, O_RDONLY | O_CLOEXEC);
        const int failed = file < 0 || fsync(file) != 0;
        const int code = errno;
        if (file >= 0) {
            (void)close(file);
        }
        if (failed) {
            return fcsl_fail(error, "cannot finish '%.200s': %s", path, strerror(code));
        }
    }
    return 0;
}

int fcsl_bag_close(fcsl_bag_t *bag, fcsl_error_t *error)
{
    int status = 0;
    char reason[REASON_BYTES] = "";
    if (fcsl_mcap_close(bag->mcap, reason, sizeof reason) != 0) {
        status = fcsl_fail(error, "cannot finish bag '%.200s': %s", bag->name, reason);
    }
    if (sync_files(bag, status == 0 ? error : NULL) != 0) {
        status = -1;
    }
    if (write_metadata(bag, 1, status == 0 ? error : NULL) != 0) {
        status = -1;
    }
    (void)pthread_mutex_destroy(&bag->lock);
    free_bag(bag);
    return status;
}

void fcsl_bag_abandon(fcsl_bag_t *bag)
{
    (void)fcsl_mcap_close(bag->mcap, NULL, 0);
    remove_folder(bag);
    (void)pthread_mutex_destroy(&bag->lock);
    free_bag(bag);
}
