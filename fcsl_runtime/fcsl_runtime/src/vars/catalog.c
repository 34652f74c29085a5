/* SPDX-License-Identifier: Apache-2.0
 *
 * The table of served paths.
 */
#define _GNU_SOURCE
#include "catalog.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "base/nearest.h"

static int by_path(const void *a, const void *b)
{
    return strcmp(((const entry_t *)a)->path, ((const entry_t *)b)->path);
}

/* Bytes of the paths that have a prefix. */
static size_t text_bytes(const fcsl_vars_block_t *blocks, uint32_t block_count)
{
    size_t bytes = 1;
    for (uint32_t b = 0; b < block_count; b++) {
        const size_t prefix = strlen(blocks[b].prefix);
        for (uint32_t f = 0; prefix > 0 && f < blocks[b].field_count; f++) {
            bytes += prefix + strlen(blocks[b].fields[f].path) + 2u;
        }
    }
    return bytes;
}

static void fill(catalog_t *catalog, size_t capacity)
{
    size_t at = 0;
    for (uint32_t b = 0; b < catalog->block_count; b++) {
        const fcsl_vars_block_t *block = &catalog->blocks[b];
        for (uint32_t f = 0; f < block->field_count; f++) {
            const char *path = block->fields[f].path;
            if (block->prefix[0] != '\0') {
                const int length =
                    snprintf(catalog->text + at, capacity - at, "%s.%s", block->prefix, block->fields[f].path);
                path = catalog->text + at;
                at += (size_t)length + 1u;
            }
            catalog->entries[catalog->count++] = (entry_t){.path = path, .block = b, .field = f};
        }
    }
    memcpy(catalog->sorted, catalog->entries, catalog->count * sizeof *catalog->entries);
    qsort(catalog->sorted, catalog->count, sizeof *catalog->sorted, by_path);
}

int fcsl_catalog_open(catalog_t *catalog, const fcsl_vars_block_t *blocks, uint32_t block_count,
                      const fcsl_history_t *history)
{
    size_t fields = 1;
    const size_t bytes = text_bytes(blocks, block_count);
    *catalog = (catalog_t){.blocks = blocks, .block_count = block_count, .machine = block_count};
    for (uint32_t b = block_count; b > 0; b--) {
        fields += blocks[b - 1].field_count;
        catalog->machine = blocks[b - 1].machine != NULL ? b - 1 : catalog->machine;
    }
    catalog->entries = calloc(fields, sizeof *catalog->entries);
    catalog->sorted = calloc(fields, sizeof *catalog->sorted);
    catalog->bases = calloc(block_count + 1u, sizeof *catalog->bases);
    catalog->text = malloc(bytes);
    if (catalog->entries == NULL || catalog->sorted == NULL || catalog->bases == NULL || catalog->text == NULL) {
        fcsl_catalog_free(catalog);
        return -1;
    }
    for (uint32_t b = 0; b < block_count; b++) {
        catalog->bases[b] = fcsl_history_part(history, b);
    }
    fill(catalog, bytes);
    return 0;
}

void fcsl_catalog_free(catalog_t *catalog)
{
    free(catalog->entries);
    free(catalog->sorted);
    free(catalog->bases);
    free(catalog->text);
    *catalog = (catalog_t){0};
}

target_t fcsl_catalog_target(const catalog_t *catalog, const entry_t *entry)
{
    const fcsl_vars_block_t *block = &catalog->blocks[entry->block];
    const fcsl_field_t *field = &block->fields[entry->field];
    return (target_t){.entry = entry,
                      .field = field,
                      .machine = block->machine,
                      .at = catalog->bases[entry->block] + field->offset,
                      .view = fcsl_view_whole(field)};
}

const entry_t *fcsl_catalog_entry(const catalog_t *catalog, const char *path)
{
    const entry_t key = {.path = path};
    return bsearch(&key, catalog->sorted, catalog->count, sizeof key, by_path);
}

const entry_t *fcsl_catalog_field(const catalog_t *catalog, uint32_t block, uint32_t field)
{
    uint32_t first = 0;
    for (uint32_t b = 0; b < block; b++) {
        first += catalog->blocks[b].field_count;
    }
    return &catalog->entries[first + field];
}

/* The entry whose path is the first `length` bytes of `path`, a comma there as good as "][". */
static const entry_t *find_entry(const catalog_t *catalog, const char *path, size_t length)
{
    char own[2 * PATH_BYTES_MAX];
    size_t at = 0;
    if (path[length] == '\0' && strchr(path, ',') == NULL) {
        return fcsl_catalog_entry(catalog, path);
    }
    for (size_t i = 0; i < length; i++) {
        if (path[i] == ',') {
            own[at++] = ']';
        }
        own[at++] = path[i] == ',' ? '[' : path[i];
    }
    own[at] = '\0';
    return fcsl_catalog_entry(catalog, own);
}

target_status_t fcsl_catalog_find(const catalog_t *catalog, const char *path, target_t *target)
{
    size_t length = strlen(path);
    if (length >= PATH_BYTES_MAX) {
        return TARGET_UNKNOWN;
    }
    /* The longest field whose path is followed by nothing but brackets. */
    for (;;) {
        const entry_t *entry = find_entry(catalog, path, length);
        if (entry != NULL) {
            *target = fcsl_catalog_target(catalog, entry);
            view_t part = target->view;
            if (fcsl_view_index(&part, path + length) != 0) {
                return TARGET_INDEX;
            }
            target->view = part;
            return TARGET_OK;
        }
        const char *bracket = memrchr(path, '[', length);
        if (bracket == NULL || strchr(bracket, '.') != NULL) {
            return fcsl_catalog_find_slice(catalog, path, target);
        }
        length = (size_t)(bracket - path);
    }
}

const char *fcsl_catalog_member(const entry_t *entry, const char *group)
{
    const size_t length = strlen(group);
    if (length == 0 || strncmp(entry->path, group, length) != 0) {
        return NULL;
    }
    const char *rest = entry->path + length;
    return *rest == '.' ? rest + 1 : *rest == '[' ? rest : NULL;
}

/* ---- the nearest name ---------------------------------------------------------------------------------------------- */

/* Whether a path is `path` with more names at one of its dots: "att.rate.outputs.u", the field, where "att.outputs.u" is a port
 * of part "att". */
static bool is_longer(const char *longer, const char *path)
{
    const size_t length = strlen(path);
    const size_t longer_length = strlen(longer);
    for (const char *dot = strchr(path, '.'); dot != NULL && longer_length > length; dot = strchr(dot + 1, '.')) {
        const size_t head = (size_t)(dot - path) + 1;
        const size_t tail = length - head + 1;
        if (strncmp(longer, path, head) == 0 && strcmp(longer + longer_length - tail, dot) == 0) {
            return true;
        }
    }
    return false;
}

const char *fcsl_catalog_nearest(const catalog_t *catalog, const char *path)
{
    for (uint32_t i = 0; i < catalog->count; i++) {
        if (is_longer(catalog->entries[i].path, path)) {
            return catalog->entries[i].path;
        }
    }
    nearest_t nearest = fcsl_nearest_begin();
    for (uint32_t i = 0; i < catalog->count; i++) {
        fcsl_nearest_consider(&nearest, catalog->entries[i].path, path);
    }
    return fcsl_nearest_if_like(&nearest, path);
}

const char *fcsl_nearest_state(const fcsl_machine_t *machine, const char *name)
{
    nearest_t nearest = fcsl_nearest_begin();
    for (uint32_t i = 0; i < machine->state_count; i++) {
        fcsl_nearest_consider(&nearest, machine->states[i].name, name);
    }
    return fcsl_nearest_if_like(&nearest, name);
}

const char *fcsl_nearest_instance(const fcsl_machine_t *machine, const char *name)
{
    nearest_t nearest = fcsl_nearest_begin();
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        fcsl_nearest_consider(&nearest, machine->instances[i].name, name);
    }
    return fcsl_nearest_if_like(&nearest, name);
}

const char *fcsl_nearest_sensor(const fcsl_machine_t *machine, const char *name)
{
    nearest_t nearest = fcsl_nearest_begin();
    for (uint32_t i = 0; i < machine->channel_count; i++) {
        if (machine->channels[i].direction == FCSL_SENSOR) {
            fcsl_nearest_consider(&nearest, machine->channels[i].name, name);
        }
    }
    return fcsl_nearest_if_like(&nearest, name);
}

const char *fcsl_nearest(const char *const *names, const char *name)
{
    nearest_t nearest = fcsl_nearest_begin();
    for (size_t i = 0; names[i] != NULL; i++) {
        fcsl_nearest_consider(&nearest, names[i], name);
    }
    return fcsl_nearest_if_like(&nearest, name);
}
