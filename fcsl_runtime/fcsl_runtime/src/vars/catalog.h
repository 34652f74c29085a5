/* SPDX-License-Identifier: Apache-2.0
 *
 * Everything that is served, by its path: the fields of all blocks.
 */
#ifndef FCSL_VARS_CATALOG_H
#define FCSL_VARS_CATALOG_H

#include <stddef.h>

#include "fcsl/fcsl_vars.h"
#include "limits.h"
#include "machine/view.h"

enum { GROUP_BYTES = 2 * PATH_BYTES_MAX };

typedef struct {
    const char *path; /* the block's prefix included */
    uint32_t block;
    uint32_t field;
} entry_t;

typedef struct {
    const fcsl_vars_block_t *blocks;
    uint32_t block_count;
    uint32_t machine; /* the first block that is a machine; block_count: none is */
    entry_t *entries; /* in the order of blocks and fields */
    entry_t *sorted;  /* by path */
    uint32_t count;
    size_t *bases;    /* per block: where it begins in a publication */
    char *text;       /* paths with a prefix */
} catalog_t;

/* A field, a part of it, or the same part of all in an array of structs. */
typedef struct {
    const entry_t *entry;
    const fcsl_field_t *field;
    const fcsl_machine_t *machine; /* null: of a block that is none */
    size_t at;                     /* of the field in a publication */
    view_t view;
} target_t;

typedef enum { TARGET_OK, TARGET_UNKNOWN, TARGET_INDEX } target_status_t;

/* 0, or -1 without memory. */
int fcsl_catalog_open(catalog_t *catalog, const fcsl_vars_block_t *blocks, uint32_t block_count,
                      const fcsl_history_t *history);
void fcsl_catalog_free(catalog_t *catalog);

/* Resolves "pilot.outputs.force", "nav.state.p[2,0:3]", "nav.inputs.targets[1:,-1].valid" (an index of an array of structs is
 * part of a field's path; such a target begins with the first field that it could mean). After TARGET_INDEX the target is all
 * of which the path names no part. */
target_status_t fcsl_catalog_find(const catalog_t *catalog, const char *path, target_t *target);
/* The same where the path is no field's own (catalog_slice.c). */
target_status_t fcsl_catalog_find_slice(const catalog_t *catalog, const char *path, target_t *target);
/* The path of a struct of an array, or of a struct in it, with the indices that fields have there: "nav.inputs.targets[2]" of
 * "nav.inputs.targets[-1]". 0, or -1 where it is none. */
int fcsl_catalog_find_group(const catalog_t *catalog, const char *path, char group[GROUP_BYTES]);
/* The entry of this path, or null. */
const entry_t *fcsl_catalog_entry(const catalog_t *catalog, const char *path);
/* The entry of a field that a block has. */
const entry_t *fcsl_catalog_field(const catalog_t *catalog, uint32_t block, uint32_t field);
/* The whole field of an entry. */
target_t fcsl_catalog_target(const catalog_t *catalog, const entry_t *entry);
/* What stands in the entry's path behind `group` when it lies in this instance, struct or array of structs; else null. */
const char *fcsl_catalog_member(const entry_t *entry, const char *group);

/* What was probably meant, or "". */
const char *fcsl_catalog_nearest(const catalog_t *catalog, const char *path);
const char *fcsl_nearest_state(const fcsl_machine_t *machine, const char *name);
const char *fcsl_nearest_instance(const fcsl_machine_t *machine, const char *name);
const char *fcsl_nearest_sensor(const fcsl_machine_t *machine, const char *name);
/* The nearest of a null-terminated list. */
const char *fcsl_nearest(const char *const *names, const char *name);

#endif /* FCSL_VARS_CATALOG_H */
