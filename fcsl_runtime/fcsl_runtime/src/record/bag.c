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

enum { PATH_BYTES = 4096, NAME_BYTES = 512, REASON_BYTES = 256 };

typedef struct {
    uint16_t channel;
    uint32_t sequence;
    char type_hash[FCSL_TYPE_HASH_BYTES];
} channel_t;

struct fcsl_bag {
    char name[PATH_BYTES];   /* the folder's, once it is published */
    char folder[PATH_BYTES]; /* where it is now */
    char file[NAME_BYTES];
    fcsl_mcap_t *mcap;
    pthread_mutex_t lock; /* topics are added by one thread while another one writes */
    fcsl_metadata_t metadata;
    fcsl_metadata_topic_t *topics;
    channel_t *channels;
};

/* The folder's path without trailing slashes, the file name ros2 bag would choose, <folder>_0.mcap, and where the folder is
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
    const int written = snprintf(bag->file, sizeof bag->file, "%s_0.mcap", last);
    const int made = snprintf(bag->folder, sizeof bag->folder, "%.*s.%s.%ld.tmp", (int)(last - bag->name), bag->name,
                              last, (long)getpid());
    return written < (int)sizeof bag->file && made < (int)sizeof bag->folder
               ? 0
               : fcsl_fail(error, "the bag's name is too long");
}

static void free_bag(fcsl_bag_t *bag)
{
    for (uint32_t i = 0; i < bag->metadata.topic_count; i++) {
        free((char *)bag->topics[i].name);
        free((char *)bag->topics[i].type);
    }
    free(bag->topics);
    free(bag->channels);
    free(bag);
}

static void remove_folder(const fcsl_bag_t *bag)
{
    char path[PATH_BYTES + NAME_BYTES + sizeof ".tmp"];
    (void)snprintf(path, sizeof path, "%s/%s.tmp", bag->folder, bag->file);
    (void)unlink(path);
    (void)snprintf(path, sizeof path, "%s/%s", bag->folder, bag->file);
    (void)unlink(path);
    fcsl_metadata_remove(bag->folder);
    (void)rmdir(bag->folder);
}

static int fail_existing(const fcsl_bag_t *bag, fcsl_error_t *error)
{
    return fcsl_fail(error, "bag '%s' exists already", bag->name);
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
    char path[PATH_BYTES + NAME_BYTES];
    char reason[REASON_BYTES] = "";
    (void)snprintf(path, sizeof path, "%s/%s", bag->folder, bag->file);
    if (fcsl_mcap_open(path, &bag->mcap, reason, sizeof reason) != 0) {
        remove_folder(bag);
        return fcsl_fail(error, "cannot create '%s/%s': %s", bag->name, bag->file, reason);
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
    if (bag->topics == NULL || bag->channels == NULL || pthread_mutex_init(&bag->lock, NULL) != 0) {
        (void)fcsl_fail(error, "out of memory for the bag");
        free_bag(bag);
        return NULL;
    }
    if (name_files(bag, path, error) != 0 || create_files(bag, error) != 0) {
        (void)pthread_mutex_destroy(&bag->lock);
        free_bag(bag);
        return NULL;
    }
    bag->metadata.file = bag->file;
    bag->metadata.topics = bag->topics;
    bag->metadata.first_ns = start_ns;
    bag->metadata.last_ns = start_ns;
    return bag;
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
    const int64_t schema_id = fcsl_mcap_add_schema(bag->mcap, type, "ros2msg", schema, strlen(schema));
    char *type_hash = bag->channels[index].type_hash;
    if (fcsl_type_hash(type, schema, type_hash) != 0) {
        return fcsl_fail(error, "topic '%.100s': the definition of '%.100s' is not understood", topic, type);
    }
    const char *keys[] = {"offered_qos_profiles", "topic_type_hash"};
    const char *values[] = {FCSL_QOS("", transient_local), type_hash};
    const int64_t channel =
        schema_id < 0 ? -1 : fcsl_mcap_add_channel(bag->mcap, topic, (uint16_t)schema_id, "cdr", keys, values, 2);
    if (channel < 0) {
        return fcsl_fail(error, "cannot add topic '%s' to the bag: %s", topic, fcsl_mcap_error(bag->mcap));
    }
    fcsl_metadata_topic_t *entry = &bag->topics[index];
    *entry = (fcsl_metadata_topic_t){.name = strdup(topic),
                                     .type = strdup(type),
                                     .type_hash = bag->channels[index].type_hash,
                                     .transient_local = transient_local};
    bag->channels[index].channel = (uint16_t)channel;
    bag->metadata.topic_count = index + 1u;
    return entry->name != NULL && entry->type != NULL ? (int)index : fcsl_fail(error, "out of memory for the bag");
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
    fcsl_metadata_t *metadata = &bag->metadata;
    if (metadata->message_count == 0 || time_ns < metadata->first_ns) {
        metadata->first_ns = time_ns;
    }
    if (metadata->message_count == 0 || time_ns > metadata->last_ns) {
        metadata->last_ns = time_ns;
    }
    metadata->message_count++;
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

int fcsl_bag_close(fcsl_bag_t *bag, fcsl_error_t *error)
{
    int status = 0;
    char reason[REASON_BYTES] = "";
    if (fcsl_mcap_close(bag->mcap, reason, sizeof reason) != 0) {
        status = fcsl_fail(error, "cannot finish bag '%.200s': %s", bag->name, reason);
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
