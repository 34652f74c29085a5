/* SPDX-License-Identifier: Apache-2.0
 *
 * Chooses the channels of telemetry and gathers their values from a publication.
 */
#include "channels.h"

#include <stdlib.h>
#include <string.h>

#include "base/path_glob.h"
#include "datagram.h"
#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_scalar.h"
#include "fcsl/fcsl_telemetry.h"

enum { DATA_HEAD_BYTES = 24 };

static const char *path_of(const void *table, uint32_t number)
{
    return ((const catalog_t *)table)->entries[number].path;
}

/* Which entries are sent; null after a message. */
static uint8_t *choose(const catalog_t *catalog, const char *globs, fcsl_error_t *error)
{
    const fcsl_paths_t paths = {.table = catalog, .count = catalog->count, .path = path_of};
    uint8_t *chosen = calloc(catalog->count + 1u, 1);
    if (chosen == NULL) {
        (void)fcsl_fail(error, "out of memory for telemetry");
    } else if (fcsl_match_paths(globs != NULL ? globs : FCSL_TELEMETRY_FIELDS, globs == NULL, &paths, chosen, error) ==
               0) {
        if (memchr(chosen, 1, catalog->count) != NULL) {
            return chosen;
        }
        (void)fcsl_fail(error, "'%s' chooses no field: '*' would send them all", globs != NULL ? globs : "");
    }
    free(chosen);
    return NULL;
}

/* Notes where the values of an entry lie; what lies behind the values before it becomes one piece with them. */
static void add(channels_t *channels, const target_t *target, uint64_t *bytes)
{
    const fcsl_field_t *field = target->field;
    piece_t *last = channels->piece_count > 0 ? &channels->pieces[channels->piece_count - 1] : NULL;
    if (last != NULL && last->type == field->type &&
        last->at + (size_t)last->count * fcsl_scalar_size(last->type) == target->at) {
        last->count += field->count;
    } else {
        channels->pieces[channels->piece_count++] =
            (piece_t){.at = target->at, .count = field->count, .type = field->type};
    }
    *bytes += field->size;
}

static int lay_out(channels_t *channels, const catalog_t *catalog, const uint8_t *chosen, fcsl_error_t *error)
{
    uint64_t bytes = DATA_HEAD_BYTES;
    channels->pieces = calloc(catalog->count + 1u, sizeof *channels->pieces);
    if (channels->pieces == NULL) {
        return fcsl_fail(error, "out of memory for telemetry");
    }
    for (uint32_t i = 0; i < catalog->count; i++) {
        if (chosen[i]) {
            const target_t target = fcsl_catalog_target(catalog, &catalog->entries[i]);
            add(channels, &target, &bytes);
        }
    }
    channels->data_bytes = (uint32_t)bytes;
    return bytes <= BODY_BYTES_MAX
               ? 0
               : fcsl_fail(error,
                           "the chosen fields have %llu bytes, and a packet has at most 16 MiB: choose fewer fields",
                           (unsigned long long)bytes);
}

static int configure(channels_t *channels, const catalog_t *catalog, const uint8_t *chosen,
                     const announcement_t *announcement, fcsl_error_t *error)
{
    const size_t bytes = fcsl_configuration_write(announcement, channels->data_bytes, catalog, chosen, NULL);
    if (bytes == 0 || bytes > BODY_BYTES_MAX) {
        return fcsl_fail(
            error, "the names of the chosen fields do not fit into a configuration (16 MiB in all, 65535 bytes or "
                   "labels in one): choose fewer fields");
    }
    channels->configuration = malloc(bytes);
    if (channels->configuration == NULL) {
        return fcsl_fail(error, "out of memory for telemetry");
    }
    channels->configuration_bytes = (uint32_t)bytes;
    (void)fcsl_configuration_write(announcement, channels->data_bytes, catalog, chosen, channels->configuration);
    return 0;
}

int fcsl_channels_open(channels_t *channels, const catalog_t *catalog, const char *globs,
                       const announcement_t *announcement, fcsl_error_t *error)
{
    *channels = (channels_t){0};
    uint8_t *chosen = choose(catalog, globs, error);
    const int status = chosen != NULL && lay_out(channels, catalog, chosen, error) == 0
                           ? configure(channels, catalog, chosen, announcement, error)
                           : -1;
    free(chosen);
    return status;
}

void fcsl_channels_close(channels_t *channels)
{
    free(channels->pieces);
    free(channels->configuration);
    *channels = (channels_t){0};
}

void fcsl_channels_pack(const channels_t *channels, const data_head_t *head, const uint8_t *publication, uint8_t *body)
{
    fcsl_put_u64(body, head->tick);
    fcsl_put_u64(body + 8, head->time_ns);
    fcsl_put_u64(body + 16, head->overwritten);
    size_t at = DATA_HEAD_BYTES;
    for (uint32_t i = 0; i < channels->piece_count; i++) {
        const piece_t *piece = &channels->pieces[i];
        fcsl_scalars_export(body + at, publication + piece->at, piece->type, piece->count);
        at += (size_t)piece->count * fcsl_scalar_size(piece->type);
    }
}
