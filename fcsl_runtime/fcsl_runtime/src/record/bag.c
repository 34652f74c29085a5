/* SPDX-License-Identifier: Apache-2.0
 *
 * A bag on disk: the folder, metadata.yaml and the MCAP file.
 */
#define _GNU_SOURCE
#include "bag.h"

#include <errno.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "fcsl/fcsl_mcap_writer.h"
#include "metadata.h"
#include "messages/type_hash.h"

enum { PATH_BYTES = 4096, NAME_BYTES = 512, REASON_BYTES = 256 };

typedef struct {
    uint16_t channel;
    uint32_t sequence;
    char type_hash[FCSL_TYPE_HASH_BYTES];
} channel_t;

struct fcsl_bag {
    char folder[PATH_BYTES];
    char file[NAME_BYTES];
    fcsl_mcap_t *mcap;
    pthread_mutex_t lock; /* topics are added by one thread while another one writes */
    fcsl_metadata_t metadata;
    fcsl_metadata_topic_t *topics;
    channel_t *channels;
};

/* The folder's path without trailing slashes, and the file name ros2 bag would choose: <folder>_0.mcap. */
static int name_files(fcsl_bag_t *bag, const char *path, fcsl_error_t *error)
{
    size_t length = strlen(path);
    while (length > 1 && path[length - 1] == '/') {
        length--;
    }
    if (length == 0 || length + NAME_BYTES >= sizeof bag->folder) {
        return fcsl_fail(error, "bag path '%.64s' is %s", path, length == 0 ? "empty" : "too long");
    }
    for (size_t i = 0; i < length; i++) {
        if ((unsigned char)path[i] < 0x20) {
            return fcsl_fail(error, "a bag's path must not contain control characters");
        }
    }
    memcpy(bag->folder, path, length);
    const char *slash = strrchr(bag->folder, '/');
    const int written = snprintf(bag->file, sizeof bag->file, "%s_0.mcap", slash != NULL ? slash + 1 : bag->folder);
    return written < (int)sizeof bag->file ? 0 : fcsl_fail(error, "the bag's name is too long");
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

static int create_files(fcsl_bag_t *bag, fcsl_error_t *error)
{
    if (mkdir(bag->folder, 0777) != 0) {
        return errno == EEXIST ? fcsl_fail(error, "bag '%s' exists already", bag->folder)
                               : fcsl_fail(error, "cannot create bag '%s': %s", bag->folder, strerror(errno));
    }
    char path[PATH_BYTES + NAME_BYTES];
    char reason[REASON_BYTES] = "";
    (void)snprintf(path, sizeof path, "%s/%s", bag->folder, bag->file);
    if (fcsl_mcap_open(path, &bag->mcap, reason, sizeof reason) != 0) {
        (void)rmdir(bag->folder);
        return fcsl_fail(error, "cannot create '%s': %s", path, reason);
    }
    return 0;
}

fcsl_bag_t *fcsl_bag_open(const char *path, fcsl_error_t *error)
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
    const char *values[] = {transient_local ? FCSL_QOS_PROFILE("", "transient_local") : "", type_hash};
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

int fcsl_bag_write_metadata(fcsl_bag_t *bag, fcsl_error_t *error)
{
    (void)pthread_mutex_lock(&bag->lock);
    const int status = fcsl_metadata_write(bag->folder, &bag->metadata, error);
    (void)pthread_mutex_unlock(&bag->lock);
    return status;
}

static int fail_writing(const fcsl_bag_t *bag, fcsl_error_t *error)
{
    return fcsl_fail(error, "cannot write to bag '%.200s': %s", bag->folder, fcsl_mcap_error(bag->mcap));
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
        status = fcsl_fail(error, "cannot finish bag '%.200s': %s", bag->folder, reason);
    }
    if (fcsl_bag_write_metadata(bag, status == 0 ? error : NULL) != 0) {
        status = -1;
    }
    (void)pthread_mutex_destroy(&bag->lock);
    free_bag(bag);
    return status;
}

void fcsl_bag_abandon(fcsl_bag_t *bag)
{
    char path[PATH_BYTES + NAME_BYTES];
    (void)fcsl_mcap_close(bag->mcap, NULL, 0);
    (void)snprintf(path, sizeof path, "%s/%s", bag->folder, bag->file);
    (void)unlink(path);
    (void)snprintf(path, sizeof path, "%s/metadata.yaml", bag->folder);
    (void)unlink(path);
    (void)rmdir(bag->folder);
    (void)pthread_mutex_destroy(&bag->lock);
    free_bag(bag);
}
