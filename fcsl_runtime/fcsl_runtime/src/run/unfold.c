/* SPDX-License-Identifier: Apache-2.0
 *
 * Makes the fields of a machine whose library has those of instances that are alike only once.
 */
#define _GNU_SOURCE
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_library.h"

enum { PART_MAX_BYTES = 255 };
/* As fcsl_validate allows. */
static const uint32_t ENTRIES_MAX = 1u << 20;

/* Whether a text is there and no longer than a path. */
static int is_part(const char *text)
{
    return text != NULL && strnlen(text, PART_MAX_BYTES + 1u) <= PART_MAX_BYTES;
}

static int are_tables(const fcsl_machine_t *machine)
{
    const fcsl_folded_fields_t *folded = machine->folded;
    if (machine->field_count > ENTRIES_MAX || machine->instance_count > ENTRIES_MAX ||
        folded->fold_count > machine->instance_count || folded->other_count > machine->field_count ||
        folded->connection_count > machine->field_count || (folded->fold_count > 0 && folded->folds == NULL) ||
        (machine->instance_count > 0 && (machine->instances == NULL || folded->instances == NULL)) ||
        (folded->other_count > 0 && folded->others == NULL) ||
        (folded->connection_count > 0 && folded->connections == NULL)) {
        return 0;
    }
    for (uint32_t i = 0; i < folded->fold_count; i++) {
        const fcsl_fold_t *fold = &folded->folds[i];
        if (fold->field_count > machine->field_count || (fold->field_count > 0 && fold->fields == NULL)) {
            return 0;
        }
        for (uint32_t j = 0; j < fold->field_count; j++) {
            if (!is_part(fold->fields[j].path)) {
                return 0;
            }
        }
    }
    return 1;
}

/* Bytes of the paths of all instances; 0 if the folds do not make the fields where the instances say. */
static size_t path_bytes(const fcsl_machine_t *machine)
{
    const fcsl_folded_fields_t *folded = machine->folded;
    const uint32_t inside = machine->field_count - folded->other_count;
    uint32_t made = 0;
    size_t bytes = 1;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        if (folded->instances[i].fold >= folded->fold_count || !is_part(instance->name)) {
            return 0;
        }
        const fcsl_fold_t *fold = &folded->folds[folded->instances[i].fold];
        const uint32_t first = machine->instances[0].first_field;
        if (first > folded->other_count || instance->first_field - first != made ||
            instance->field_count != fold->field_count || fold->field_count > inside - made) {
            return 0;
        }
        made += fold->field_count;
        for (uint32_t j = 0; j < fold->field_count; j++) {
            bytes += strlen(instance->name) + strlen(fold->fields[j].path) + 1u;
        }
    }
    return made == inside ? bytes : 0;
}

/* The fields of all instances behind each other; their paths behind `text`. */
static void unfold_instances(const fcsl_machine_t *machine, fcsl_field_t *fields, char *text)
{
    const fcsl_folded_fields_t *folded = machine->folded;
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_folded_instance_t *one = &folded->instances[i];
        const fcsl_fold_t *fold = &folded->folds[one->fold];
        const char *name = machine->instances[i].name;
        const size_t name_bytes = strlen(name);
        for (uint32_t j = 0; j < fold->field_count; j++) {
            const size_t rest = strlen(fold->fields[j].path) + 1u;
            fcsl_field_t *field = fields++;
            *field = fold->fields[j];
            field->path = text;
            field->offset += one->offset; /* fcsl_validate refuses one that is not in the struct */
            field->instance = (int32_t)i;
            field->connected_from = FCSL_NONE;
            memcpy(text, name, name_bytes);
            memcpy(text + name_bytes, fold->fields[j].path, rest);
            text += name_bytes + rest;
        }
    }
}

const fcsl_machine_t *fcsl_library_unfold(const fcsl_machine_t *machine, void **made, fcsl_error_t *error)
{
    *made = NULL;
    if (machine->abi_version != FCSL_ABI_VERSION || machine->fields != NULL || machine->folded == NULL) {
        return machine; /* as it is; fcsl_validate judges it */
    }
    const fcsl_folded_fields_t *folded = machine->folded;
    const size_t text_bytes = are_tables(machine) ? path_bytes(machine) : 0;
    if (text_bytes == 0) {
        (void)fcsl_fail(error, "the folded fields of the machine's descriptor are inconsistent");
        return NULL;
    }
    const size_t field_bytes = machine->field_count * sizeof *machine->fields;
    char *memory = malloc(sizeof *machine + field_bytes + text_bytes);
    if (memory == NULL) {
        (void)fcsl_fail(error, "out of memory for the fields of a machine");
        return NULL;
    }
    fcsl_machine_t *whole = (fcsl_machine_t *)(void *)memory;
    fcsl_field_t *fields = (fcsl_field_t *)(void *)(memory + sizeof *machine);
    const uint32_t before = machine->instance_count > 0 ? machine->instances[0].first_field : folded->other_count;
    const uint32_t inside = machine->field_count - folded->other_count;
    const uint32_t behind = folded->other_count - before;
    if (before > 0) {
        memcpy(fields, folded->others, before * sizeof *fields);
    }
    unfold_instances(machine, fields + before, memory + sizeof *machine + field_bytes);
    if (behind > 0) {
        memcpy(fields + before + inside, folded->others + before, behind * sizeof *fields);
    }
    for (uint32_t i = 0; i < folded->connection_count; i++) {
        const fcsl_folded_connection_t *connection = &folded->connections[i];
        if (connection->field >= machine->field_count) {
            (void)fcsl_fail(error, "a folded connection of the machine's descriptor is inconsistent");
            free(memory);
            return NULL;
        }
        fields[connection->field].connected_from = connection->connected_from;
    }
    *whole = *machine;
    whole->fields = fields;
    whole->folded = NULL;
    *made = memory;
    return whole;
}
