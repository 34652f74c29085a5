/* SPDX-License-Identifier: Apache-2.0
 *
 * Walks through the bytes of a CDR message, which come from anywhere.
 */
#include "ros_walk.h"

#include <string.h>

#include "fcsl/fcsl_scalar.h"

/* The bytes not walked yet; they begin at an offset whose alignment counts from behind the encapsulation. */
typedef struct {
    const uint8_t *from;
    size_t at;
    size_t size;
} cursor_t;

/* The next `size` bytes at the next multiple of `align`, or null at the end of the message. */
static const uint8_t *take(cursor_t *cursor, size_t align, size_t size)
{
    const size_t padding = (align - cursor->at % align) % align;
    const size_t left = cursor->size - cursor->at;
    if (padding > left || size > left - padding) {
        return NULL;
    }
    const uint8_t *bytes = cursor->from + cursor->at + padding;
    cursor->at += padding + size;
    return bytes;
}

/* The length in front of a string or sequence: 0 at the end of the message. */
static int take_length(cursor_t *cursor, uint32_t *length)
{
    const uint8_t *bytes = take(cursor, 4, 4);
    *length = bytes != NULL ? fcsl_get_u32(bytes) : 0;
    return bytes != NULL;
}

/* A string, of `length` characters before its NUL; an empty one may come without the NUL. */
static fcsl_ros_status_t take_string(cursor_t *cursor, const char **text, uint32_t *length)
{
    *text = "";
    if (!take_length(cursor, length)) {
        return FCSL_ROS_TRUNCATED;
    }
    if (*length == 0) {
        return FCSL_ROS_TAKEN;
    }
    const uint8_t *bytes = take(cursor, 1, *length);
    if (bytes == NULL) {
        return FCSL_ROS_TRUNCATED;
    }
    *length -= 1u;
    *text = (const char *)bytes;
    return bytes[*length] == 0 ? FCSL_ROS_TAKEN : FCSL_ROS_MALFORMED;
}

static int same_text(const char *name, const char *text, uint32_t length)
{
    return strlen(name) == length && memcmp(name, text, length) == 0;
}

static fcsl_ros_status_t walk_string(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                     cursor_t *cursor)
{
    const char *text = NULL;
    uint32_t length = 0;
    const fcsl_ros_status_t status = take_string(cursor, &text, &length);
    if (status != FCSL_ROS_TAKEN || part->first == FCSL_ROS_NONE) {
        return status;
    }
    return same_text(conversion->names[part->first], text, length) ? FCSL_ROS_TAKEN : FCSL_ROS_FRAME;
}

/* Each string takes four bytes or more of the message, so there are no more turns than that. */
static fcsl_ros_status_t walk_names(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                    fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    uint32_t count = 0;
    if (!take_length(cursor, &count)) {
        return FCSL_ROS_TRUNCATED;
    }
    for (uint32_t i = 0; i < count; i++) {
        const char *text = NULL;
        uint32_t length = 0;
        const fcsl_ros_status_t status = take_string(cursor, &text, &length);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
        for (uint32_t name = part->first; name < part->first + part->count; name++) {
            if (walk->found[name] == FCSL_ROS_NONE && same_text(conversion->names[name], text, length)) {
                walk->found[name] = i;
            }
        }
    }
    return FCSL_ROS_TAKEN;
}

static fcsl_ros_status_t walk_sequence(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                       fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    uint32_t count = 0;
    if (!take_length(cursor, &count)) {
        return FCSL_ROS_TRUNCATED;
    }
    /* An empty sequence is not aligned. No overflow: count and size are of 32 bits, what is computed of 64. */
    const uint8_t *numbers = count == 0 ? cursor->from : take(cursor, part->align, (size_t)count * part->size);
    if (numbers == NULL) {
        return FCSL_ROS_TRUNCATED;
    }
    for (uint32_t i = 0; i < part->count; i++) {
        const fcsl_ros_pick_t *pick = &conversion->picks[part->first + i];
        if (pick->count > 0) {
            walk->anchors[pick->anchor] = pick->count == count ? numbers : NULL;
            continue;
        }
        const uint32_t element = pick->name != FCSL_ROS_NONE ? walk->found[pick->name] : pick->element;
        walk->anchors[pick->anchor] = element < count ? numbers + (size_t)element * part->size : NULL;
    }
    return FCSL_ROS_TAKEN;
}

/* Walks the parts. A turn of a loop takes at least one byte (fcsl_ros_walk_valid), so the message bounds them all. */
static fcsl_ros_status_t walk_parts(const fcsl_ros_reader_plan_t *conversion, fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    uint32_t left[FCSL_ROS_DEPTH_MAX]; /* turns of the loops that the walk is in */
    uint32_t depth = 0;
    fcsl_ros_status_t status = FCSL_ROS_TAKEN;
    for (uint32_t i = 0; i < conversion->part_count && status == FCSL_ROS_TAKEN; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        switch (part->code) {
        case FCSL_ROS_BLOCK: {
            const uint8_t *bytes = take(cursor, part->align, part->size);
            if (part->first != FCSL_ROS_NONE) {
                walk->anchors[part->first] = bytes;
            }
            status = bytes != NULL ? FCSL_ROS_TAKEN : FCSL_ROS_TRUNCATED;
            break;
        }
        case FCSL_ROS_STRING:
            status = walk_string(conversion, part, cursor);
            break;
        case FCSL_ROS_NAMES:
            status = walk_names(conversion, part, walk, cursor);
            break;
        case FCSL_ROS_SEQUENCE:
            status = walk_sequence(conversion, part, walk, cursor);
            break;
        case FCSL_ROS_COUNT: {
            uint32_t count = 0;
            status = !take_length(cursor, &count) ? FCSL_ROS_TRUNCATED
                     : count < part->count        ? FCSL_ROS_SHAPE
                                                  : FCSL_ROS_TAKEN;
            left[depth++] = count - part->count;
            break;
        }
        case FCSL_ROS_REPEAT:
            if (left[depth - 1u] == 0) {
                depth--;
                i = part->first; /* behind its END */
            } else {
                left[depth - 1u]--;
            }
            break;
        default: /* FCSL_ROS_END */
            i = part->first - 1u; /* to its REPEAT */
            break;
        }
    }
    return status;
}

fcsl_ros_status_t fcsl_ros_walk(const fcsl_ros_reader_plan_t *conversion, fcsl_ros_walk_t *walk, const uint8_t *cdr,
                                size_t size)
{
    if (size < FCSL_ROS_ENCAPSULATION_BYTES) {
        return FCSL_ROS_TRUNCATED;
    }
    if (cdr[0] != 0 || cdr[1] != 1) {
        return FCSL_ROS_ENCODING;
    }
    for (uint32_t i = 0; i < conversion->name_count; i++) {
        walk->found[i] = FCSL_ROS_NONE;
    }
    cursor_t cursor = {.from = cdr + FCSL_ROS_ENCAPSULATION_BYTES, .size = size - FCSL_ROS_ENCAPSULATION_BYTES};
    const fcsl_ros_status_t status = walk_parts(conversion, walk, &cursor);
    walk->end = FCSL_ROS_ENCAPSULATION_BYTES + cursor.at;
    return status;
}

static int is_size(uint32_t size)
{
    return size == 1u || size == 2u || size == 4u || size == 8u;
}

static int in_range(uint32_t first, uint32_t count, uint32_t whole)
{
    return count <= whole && first <= whole - count;
}

static int sequence_valid(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part)
{
    if (!is_size(part->size) || part->align != part->size ||
        !in_range(part->first, part->count, conversion->pick_count)) {
        return 0;
    }
    for (uint32_t i = 0; i < part->count; i++) {
        const fcsl_ros_pick_t *pick = &conversion->picks[part->first + i];
        if (pick->count > UINT32_MAX / 8u || (pick->name != FCSL_ROS_NONE && pick->name >= conversion->name_count)) {
            return 0;
        }
    }
    return 1;
}

/* A part that is not of a loop; in one, where it may not be met at all, nothing can be read. */
static int part_valid(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part, int in_loop)
{
    const int reads = (part->code == FCSL_ROS_BLOCK && part->first != FCSL_ROS_NONE) ||
                      (part->code == FCSL_ROS_SEQUENCE && part->count > 0);
    if (reads && in_loop) {
        return 0;
    }
    switch (part->code) {
    case FCSL_ROS_BLOCK:
        return part->size > 0 && is_size(part->align);
    case FCSL_ROS_STRING:
        return part->first == FCSL_ROS_NONE || part->first < conversion->name_count;
    case FCSL_ROS_NAMES:
        return in_range(part->first, part->count, conversion->name_count);
    case FCSL_ROS_SEQUENCE:
        return sequence_valid(conversion, part);
    default:
        return 0;
    }
}

/* REPEAT and END point at each other, something between them takes bytes, and every REPEAT has its COUNT before it. */
int fcsl_ros_walk_valid(const fcsl_ros_reader_plan_t *conversion)
{
    uint32_t repeats[FCSL_ROS_DEPTH_MAX];
    uint32_t counts_at[FCSL_ROS_DEPTH_MAX]; /* counts, at each of them */
    uint32_t counts = 0; /* loops entered: those of which only the COUNT was met, and those in `repeats` */
    uint32_t depth = 0;
    if (conversion->part_count > FCSL_ROS_PARTS_MAX || conversion->name_count > FCSL_ROS_NAMES_MAX) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->part_count; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        if (part->code == FCSL_ROS_COUNT) {
            if (counts == FCSL_ROS_DEPTH_MAX) {
                return 0;
            }
            counts++;
        } else if (part->code == FCSL_ROS_REPEAT) {
            if (depth == counts || part->first <= i + 1u || part->first >= conversion->part_count ||
                conversion->parts[part->first].code != FCSL_ROS_END || conversion->parts[part->first].first != i ||
                conversion->parts[i + 1u].code >= FCSL_ROS_REPEAT) {
                return 0;
            }
            counts_at[depth] = counts;
            repeats[depth++] = i;
        } else if (part->code == FCSL_ROS_END) {
            if (depth == 0 || repeats[depth - 1u] != part->first || counts_at[depth - 1u] != counts) {
                return 0;
            }
            depth--;
            counts--;
        } else if (!part_valid(conversion, part, depth > 0)) {
            return 0;
        }
    }
    return depth == 0 && counts == 0;
}
