/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes the configuration that tells a receiver what the packets hold.
 */
#include "configuration.h"

#include <string.h>

#include "machine/health_name.h"

typedef struct {
    uint8_t *bytes; /* null: only counts */
    size_t at;
    int overlong;
} writer_t;

static void put(writer_t *writer, uint64_t value, uint32_t size)
{
    for (uint32_t i = 0; writer->bytes != NULL && i < size; i++) {
        writer->bytes[writer->at + i] = (uint8_t)(value >> (8u * i));
    }
    writer->at += size;
}

/* A count that has 16 bits. */
static void put_count(writer_t *writer, size_t count)
{
    writer->overlong = writer->overlong || count > UINT16_MAX;
    put(writer, count, 2);
}

static void put_text(writer_t *writer, const char *before, const char *text)
{
    const size_t first = strlen(before);
    const size_t second = strlen(text);
    put_count(writer, first + second);
    if (writer->bytes != NULL) {
        memcpy(writer->bytes + writer->at, before, first);
        memcpy(writer->bytes + writer->at + first, text, second);
    }
    writer->at += first + second;
}

/* The names of what the numbers of a type stand for. */
static void put_labels(writer_t *writer, const fcsl_machine_t *machine, uint8_t type)
{
    if (type == FCSL_HEALTH) {
        put_count(writer, FCSL_STALE + 1);
        for (int32_t i = 0; i <= FCSL_STALE; i++) {
            put_text(writer, "", fcsl_health_name(i));
        }
    } else if (type == FCSL_STATE && machine != NULL) {
        put_count(writer, machine->state_count);
        for (uint32_t i = 0; i < machine->state_count; i++) {
            put_text(writer, "", machine->states[i].name);
        }
    } else if (type == FCSL_TRANSITION_REQUEST && machine != NULL) {
        put_count(writer, (size_t)machine->request_count + 1u);
        put_text(writer, "", "");
        for (uint32_t i = 0; i < machine->request_count; i++) {
            put_text(writer, "tr_", machine->requests[i]);
        }
    } else {
        put_count(writer, 0);
    }
}

static void put_channel(writer_t *writer, const catalog_t *catalog, const entry_t *entry)
{
    const fcsl_vars_block_t *block = &catalog->blocks[entry->block];
    const fcsl_field_t *field = &block->fields[entry->field];
    put_text(writer, "", entry->path);
    put(writer, field->type, 1);
    put(writer, field->rank, 1);
    for (uint32_t i = 0; i < field->rank; i++) {
        put(writer, field->shape[i], 4);
    }
    put_text(writer, "", field->unit);
    put_labels(writer, block->machine, field->type);
}

size_t fcsl_configuration_write(const announcement_t *announcement, uint32_t data_bytes, const catalog_t *catalog,
                                const uint8_t *chosen, uint8_t *bytes)
{
    writer_t writer = {.bytes = bytes};
    uint32_t count = 0;
    for (uint32_t i = 0; i < catalog->count; i++) {
        count += chosen[i];
    }
    put(&writer, announcement->machine->abi_version, 4);
    put(&writer, announcement->machine->tick_hz, 8);
    put(&writer, announcement->every, 4);
    put(&writer, (uint64_t)announcement->wall_ns, 8);
    put(&writer, data_bytes, 4);
    put_text(&writer, "", announcement->machine->source_hash);
    put_text(&writer, "", announcement->machine->name);
    put_text(&writer, "", announcement->views);
    put(&writer, count, 4);
    for (uint32_t i = 0; i < catalog->count; i++) {
        if (chosen[i]) {
            put_channel(&writer, catalog, &catalog->entries[i]);
        }
    }
    return writer.overlong ? 0 : writer.at;
}
