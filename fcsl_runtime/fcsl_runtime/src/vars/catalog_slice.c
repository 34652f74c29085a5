/* SPDX-License-Identifier: Apache-2.0
 *
 * Paths through arrays of structs, "nav.inputs.targets[1:].pose.position[0]": the fields of such an array lie at equal
 * distances, so that its axes are axes of the view as those of the field are. Each bracket belongs to the name before it.
 */
#include <inttypes.h>
#include <stdio.h>
#include <string.h>

#include "catalog.h"

enum { OWN_BYTES = GROUP_BYTES };

/* The path of the first field that is meant, all indices 0, and what is known of each index. */
typedef struct {
    char text[OWN_BYTES];
    size_t length;
    uint32_t axes;
    uint32_t groups;
    struct {
        size_t at; /* of its 0 in the text */
        uint32_t extent;
        uint32_t group;
    } axis[RANK_MAX];
    struct {
        const char *text; /* "[1:,0]" in the path */
        size_t length;
    } group[RANK_MAX];
} origin_t;

/* Whether a path begins so. */
static int begins(const catalog_t *catalog, const char *text)
{
    uint32_t low = 0;
    uint32_t high = catalog->count;
    while (low < high) {
        const uint32_t middle = low + (high - low) / 2u;
        if (strcmp(catalog->sorted[middle].path, text) < 0) {
            low = middle + 1u;
        } else {
            high = middle;
        }
    }
    return low < catalog->count && strncmp(catalog->sorted[low].path, text, strlen(text)) == 0;
}

/* The text with index `number` in place of the 0 at `at`, and `rest` behind it. */
static const char *with_index(const origin_t *origin, size_t at, uint32_t number, const char *rest, char out[OWN_BYTES])
{
    const int length =
        snprintf(out, OWN_BYTES, "%.*s%" PRIu32 "%s%s", (int)at, origin->text, number, origin->text + at + 1u, rest);
    return length > 0 && length < OWN_BYTES ? out : "";
}

/* How many there are: all below it exist, so it is found by doubling and halving. */
static uint32_t extent_of(const catalog_t *catalog, const origin_t *origin, size_t at)
{
    char text[OWN_BYTES];
    uint32_t known = 0;
    uint32_t beyond = 1;
    while (beyond < catalog->count && begins(catalog, with_index(origin, at, beyond, ".", text))) {
        known = beyond;
        beyond *= 2u;
    }
    while (beyond - known > 1u) {
        const uint32_t middle = known + (beyond - known) / 2u;
        if (begins(catalog, with_index(origin, at, middle, ".", text))) {
            known = middle;
        } else {
            beyond = middle;
        }
    }
    return known + 1u;
}

static int append(origin_t *origin, const char *text, size_t length)
{
    if (origin->length + length >= OWN_BYTES) {
        return -1;
    }
    memcpy(origin->text + origin->length, text, length);
    origin->length += length;
    origin->text[origin->length] = '\0';
    return 0;
}

/* Puts as many indices 0 as the array of structs has. */
static int append_axes(const catalog_t *catalog, origin_t *origin)
{
    char text[OWN_BYTES];
    const uint32_t first = origin->axes;
    do {
        if (origin->axes == RANK_MAX || append(origin, "[0]", 3) != 0) {
            return -1;
        }
        origin->axis[origin->axes].group = origin->groups;
        origin->axis[origin->axes++].at = origin->length - 2u;
        (void)snprintf(text, sizeof text, "%.*s.", OWN_BYTES - 2, origin->text);
    } while (!begins(catalog, text));
    for (uint32_t i = first; i < origin->axes; i++) {
        origin->axis[i].extent = extent_of(catalog, origin, origin->axis[i].at);
    }
    origin->groups++;
    return 0;
}

/* Reads the path up to its last name; returns what stands behind that, or null when it goes through no such array. */
static const char *read_origin(const catalog_t *catalog, const char *path, origin_t *origin)
{
    const char *bracket = strchr(path, '[');
    while (bracket != NULL) {
        const char *end = bracket;
        while (*end == '[' && strchr(end, ']') != NULL) {
            end = strchr(end, ']') + 1;
        }
        if (*end != '.') {
            break;
        }
        if (append(origin, path, (size_t)(bracket - path)) != 0 || origin->groups == RANK_MAX) {
            return NULL;
        }
        origin->group[origin->groups].text = bracket;
        origin->group[origin->groups].length = (size_t)(end - bracket);
        if (append_axes(catalog, origin) != 0) {
            return NULL;
        }
        path = end;
        bracket = strchr(path, '[');
    }
    const size_t left = bracket != NULL ? (size_t)(bracket - path) : strlen(path);
    return origin->groups > 0 && append(origin, path, left) == 0 ? path + left : NULL;
}

/* The distance of neighbours along an axis; -1 where the table is not what an array of structs gives. */
static int measure(const catalog_t *catalog, const origin_t *origin, uint32_t i, const entry_t *base, view_t *view)
{
    char text[OWN_BYTES];
    const uint32_t extent = origin->axis[i].extent;
    const entry_t *last = fcsl_catalog_entry(catalog, with_index(origin, origin->axis[i].at, extent - 1u, "", text));
    if (last == NULL || last->block != base->block) {
        return -1;
    }
    const fcsl_field_t *fields = catalog->blocks[base->block].fields;
    const int64_t bytes = (int64_t)fields[last->field].offset - (int64_t)fields[base->field].offset;
    const int64_t between = (int64_t)last->field - (int64_t)base->field;
    const int64_t steps = extent > 1u ? (int64_t)extent - 1 : 1;
    if (bytes < 0 || between < 0 || bytes % steps != 0 || between % steps != 0 ||
        fields[last->field].type != fields[base->field].type || fields[last->field].size != fields[base->field].size) {
        return -1;
    }
    view->axes[view->rank].stride = bytes / steps;
    view->axes[view->rank].fields = between / steps;
    view->axes[view->rank++].count = extent;
    return 0;
}

/* Whether the field farthest from the first is where the distances say: then all between lie inside, too. */
static int is_regular(const catalog_t *catalog, const origin_t *origin, const entry_t *base, const view_t *whole)
{
    origin_t farthest = *origin;
    char text[OWN_BYTES];
    const fcsl_field_t *fields = catalog->blocks[base->block].fields;
    int64_t at = fields[base->field].offset;
    int64_t field = base->field;
    for (uint32_t i = origin->axes; i > 0; i--) { /* from behind: places before it stay */
        const uint32_t steps = origin->axis[i - 1].extent - 1u;
        at += (int64_t)steps * whole->axes[i - 1].stride;
        field += (int64_t)steps * whole->axes[i - 1].fields;
        (void)snprintf(farthest.text, sizeof farthest.text, "%s",
                       with_index(&farthest, origin->axis[i - 1].at, steps, "", text));
    }
    const entry_t *last = fcsl_catalog_entry(catalog, farthest.text);
    return last != NULL && last->block == base->block && last->field == field && fields[field].offset == at;
}

/* The axes of group `g`, narrowed by what the path says of them. */
static int narrow_group(const origin_t *origin, const view_t *whole, uint32_t g, view_t *part)
{
    char text[OWN_BYTES];
    *part = (view_t){.rank = 0};
    for (uint32_t i = 0; i < origin->axes; i++) {
        if (origin->axis[i].group == g) {
            part->axes[part->rank++] = whole->axes[i];
        }
    }
    const int length = snprintf(text, sizeof text, "%.*s", (int)origin->group[g].length, origin->group[g].text);
    return length >= 0 && (size_t)length < sizeof text ? fcsl_view_index(part, text) : -1;
}

/* Narrows `whole`, the axes of all groups, by what the path says of each; they come before those of the field. */
static int narrow(const origin_t *origin, const view_t *whole, view_t *view)
{
    view_t found = {.rank = 0};
    for (uint32_t g = 0; g < origin->groups; g++) {
        view_t part;
        if (narrow_group(origin, whole, g, &part) != 0 || fcsl_view_append(&found, &part) != 0) {
            return -1;
        }
    }
    if (fcsl_view_append(&found, view) != 0) {
        return -1;
    }
    *view = found;
    return 0;
}

target_status_t fcsl_catalog_find_slice(const catalog_t *catalog, const char *path, target_t *target)
{
    origin_t origin = {.length = 0};
    const char *rest = read_origin(catalog, path, &origin);
    const entry_t *base = rest != NULL ? fcsl_catalog_entry(catalog, origin.text) : NULL;
    view_t whole = {.rank = 0};
    if (base == NULL) {
        return TARGET_UNKNOWN;
    }
    for (uint32_t i = 0; i < origin.axes; i++) {
        if (measure(catalog, &origin, i, base, &whole) != 0) {
            return TARGET_UNKNOWN;
        }
    }
    if (!is_regular(catalog, &origin, base, &whole)) {
        return TARGET_UNKNOWN;
    }
    *target = fcsl_catalog_target(catalog, base);
    view_t part = target->view;
    if (fcsl_view_index(&part, rest) == 0 && narrow(&origin, &whole, &part) == 0) {
        target->view = part;
        return TARGET_OK;
    }
    if (fcsl_view_append(&whole, &target->view) == 0) {
        target->view = whole;
    }
    return TARGET_INDEX;
}

int fcsl_catalog_find_group(const catalog_t *catalog, const char *path, char group[GROUP_BYTES])
{
    origin_t origin = {.length = 0};
    char text[OWN_BYTES];
    view_t whole = {.rank = 0};
    view_t part = {.rank = 0};
    int64_t number = 0; /* of the struct, row by row */
    const int length = snprintf(text, sizeof text, "%s.", path);
    if (length < 0 || length > PATH_BYTES_MAX || strchr(path, ':') != NULL ||
        read_origin(catalog, text, &origin) == NULL || !begins(catalog, origin.text)) {
        return -1;
    }
    whole.rank = origin.axes;
    for (uint32_t i = origin.axes; i > 0; i--) {
        whole.axes[i - 1].count = origin.axis[i - 1].extent;
        whole.axes[i - 1].stride = i == origin.axes ? 1 : whole.axes[i].stride * whole.axes[i].count;
    }
    for (uint32_t g = 0; g < origin.groups; g++) {
        if (part.rank > 0 || narrow_group(&origin, &whole, g, &part) != 0) {
            return -1;
        }
        number += part.offset;
    }
    /* Axes may be left at the end: of an array in the array. */
    const uint32_t named = origin.axes - part.rank;
    if (part.rank > 0 && path[length - 2] != ']') {
        return -1;
    }
    origin.text[part.rank > 0 ? origin.axis[named].at - 1u : origin.length - 1u] = '\0';
    for (uint32_t i = named; i > 0; i--) { /* from behind: places before it stay */
        const int64_t index = number / whole.axes[i - 1].stride % whole.axes[i - 1].count;
        (void)snprintf(origin.text, sizeof origin.text, "%s",
                       with_index(&origin, origin.axis[i - 1].at, (uint32_t)index, "", text));
    }
    (void)snprintf(group, GROUP_BYTES, "%s", origin.text);
    return 0;
}
