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

static fcsl_ros_status_t walk_choice(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                     fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    const char *text = NULL;
    uint32_t length = 0;
    const fcsl_ros_status_t status = take_string(cursor, &text, &length);
    if (status != FCSL_ROS_TAKEN) {
        return status;
    }
    uint32_t index = 0;
    while (index < part->count && !same_text(conversion->names[part->first + index], text, length)) {
        index++;
    }
    walk->indices[part->size] = index;
    walk->anchors[part->size] = (const uint8_t *)&walk->indices[part->size];
    return FCSL_ROS_TAKEN;
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

int fcsl_ros_pick_is_limited(const fcsl_ros_pick_t *pick)
{
    return pick->count > 0 && pick->element == 1u;
}

int fcsl_ros_pick_is_length(const fcsl_ros_pick_t *pick)
{
    return pick->count == 0 && pick->element == FCSL_ROS_NONE && pick->name == FCSL_ROS_NONE;
}

static fcsl_ros_status_t walk_sequence(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                       fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    uint32_t count = 0;
    if (!take_length(cursor, &count)) {
        return FCSL_ROS_TRUNCATED;
    }
    const uint8_t *length = cursor->from + cursor->at - sizeof count;
    /* An empty sequence is not aligned. No overflow: count and size are of 32 bits, what is computed of 64. */
    const uint8_t *numbers = count == 0 ? cursor->from : take(cursor, part->align, (size_t)count * part->size);
    if (numbers == NULL) {
        return FCSL_ROS_TRUNCATED;
    }
    for (uint32_t i = 0; i < part->count; i++) {
        const fcsl_ros_pick_t *pick = &conversion->picks[part->first + i];
        if (pick->count > 0) {
            const int fits = fcsl_ros_pick_is_limited(pick) ? count <= pick->count : count == pick->count;
            walk->anchors[pick->anchor] = fits ? numbers : NULL;
            walk->lengths[pick->anchor] = fits ? count : 0u;
            continue;
        }
        if (fcsl_ros_pick_is_length(pick)) {
            walk->anchors[pick->anchor] = length;
            continue;
        }
        const uint32_t element = pick->name != FCSL_ROS_NONE ? walk->found[pick->name] : pick->element;
        walk->anchors[pick->anchor] = element < count ? numbers + (size_t)element * part->size : NULL;
    }
    return FCSL_ROS_TAKEN;
}

/* A part that takes bytes and is not of a loop. */
static fcsl_ros_status_t walk_bytes(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                    fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    switch (part->code) {
    case FCSL_ROS_BLOCK: {
        const uint8_t *bytes = take(cursor, part->align, part->size);
        if (part->first != FCSL_ROS_NONE) {
            walk->anchors[part->first] = bytes;
        }
        return bytes != NULL ? FCSL_ROS_TAKEN : FCSL_ROS_TRUNCATED;
    }
    case FCSL_ROS_STRING:
        return walk_string(conversion, part, cursor);
    case FCSL_ROS_NAMES:
        return walk_names(conversion, part, walk, cursor);
    case FCSL_ROS_CHOICE:
        return walk_choice(conversion, part, walk, cursor);
    default: /* FCSL_ROS_SEQUENCE */
        return walk_sequence(conversion, part, walk, cursor);
    }
}

/* The search for an element of a sequence; no two are within one another. */
typedef struct {
    cursor_t start; /* where the sequence begins */
    uint32_t left; /* elements that were not looked at */
    int is_it; /* whether this one is the one */
} search_t;

/* Goes to the first element. Returns the part before the next one. */
static uint32_t begin_search(uint32_t at, const fcsl_ros_part_t *part, search_t *search, fcsl_ros_walk_t *walk,
                             cursor_t *cursor, fcsl_ros_status_t *status)
{
    *search = (search_t){.start = *cursor};
    *status = take_length(cursor, &search->left) ? FCSL_ROS_TAKEN : FCSL_ROS_TRUNCATED;
    for (uint32_t i = 0; i < part->count; i++) {
        walk->anchors[part->size + i] = NULL;
    }
    if (search->left == 0) {
        *cursor = search->start;
        return part->first;
    }
    search->left--;
    return at;
}

/* Behind an element: on behind the search, or on to the next element. */
static uint32_t end_of_element(uint32_t at, const fcsl_ros_reader_plan_t *conversion, search_t *search,
                               fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    const uint32_t find = conversion->parts[at].first;
    if (!search->is_it && search->left > 0) {
        search->left--;
        return find;
    }
    for (uint32_t i = 0; !search->is_it && i < conversion->parts[find].count; i++) {
        walk->anchors[conversion->parts[find].size + i] = NULL;
    }
    *cursor = search->start;
    return at;
}

static fcsl_ros_status_t walk_key(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part,
                                  search_t *search, cursor_t *cursor)
{
    const char *text = NULL;
    uint32_t length = 0;
    const fcsl_ros_status_t status = take_string(cursor, &text, &length);
    search->is_it = status == FCSL_ROS_TAKEN && same_text(conversion->names[part->first], text, length);
    return status;
}

/* Walks the parts. A turn of a loop takes at least one byte (fcsl_ros_walk_valid), so the message bounds them all. */
static fcsl_ros_status_t walk_parts(const fcsl_ros_reader_plan_t *conversion, fcsl_ros_walk_t *walk, cursor_t *cursor)
{
    uint32_t left[FCSL_ROS_DEPTH_MAX]; /* turns of the loops that the walk is in */
    uint32_t depth = 0;
    search_t search = {0};
    fcsl_ros_status_t status = FCSL_ROS_TAKEN;
    for (uint32_t i = 0; i < conversion->part_count && status == FCSL_ROS_TAKEN; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        switch (part->code) {
        case FCSL_ROS_COUNT: {
            uint32_t count = 0;
            status = !take_length(cursor, &count) ? FCSL_ROS_TRUNCATED
                     : count < part->count        ? FCSL_ROS_SHAPE
                                                  : FCSL_ROS_TAKEN;
            if (part->first != FCSL_ROS_NONE) {
                walk->anchors[part->first] = cursor->from + cursor->at - sizeof count;
            }
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
        case FCSL_ROS_END:
            i = part->first - 1u; /* to its REPEAT */
            break;
        case FCSL_ROS_FIND:
            i = begin_search(i, part, &search, walk, cursor, &status);
            break;
        case FCSL_ROS_KEY:
            status = walk_key(conversion, part, &search, cursor);
            break;
        case FCSL_ROS_FOUND:
            i = end_of_element(i, conversion, &search, walk, cursor);
            break;
        default:
            status = walk_bytes(conversion, part, walk, cursor);
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
                      (part->code == FCSL_ROS_SEQUENCE && part->count > 0) || part->code == FCSL_ROS_CHOICE;
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
    case FCSL_ROS_CHOICE:
        return part->size < conversion->anchor_count && in_range(part->first, part->count, conversion->name_count);
    case FCSL_ROS_SEQUENCE:
        return sequence_valid(conversion, part);
    default:
        return 0;
    }
}

/* What the checks of the parts before a part found. */
typedef struct {
    uint32_t repeats[FCSL_ROS_DEPTH_MAX];
    uint32_t counts_at[FCSL_ROS_DEPTH_MAX]; /* counts, at each of them */
    uint32_t counts; /* loops entered: those of which only the COUNT was met, and those in `repeats` */
    uint32_t depth;
    uint32_t find; /* the search entered, or FCSL_ROS_NONE */
    uint32_t find_counts; /* counts, at it */
    int has_key;
} nesting_t;

/* FIND and FOUND point at each other, with a KEY between them; they are not within a loop, nor within one another. */
static int search_valid(const fcsl_ros_reader_plan_t *conversion, uint32_t i, nesting_t *nesting)
{
    const fcsl_ros_part_t *part = &conversion->parts[i];
    if (part->code == FCSL_ROS_FIND) {
        const int is_closed = part->first > i && part->first < conversion->part_count &&
                              conversion->parts[part->first].code == FCSL_ROS_FOUND &&
                              conversion->parts[part->first].first == i;
        const int is_alone = nesting->find == FCSL_ROS_NONE && nesting->depth == 0;
        nesting->find = i;
        nesting->find_counts = nesting->counts;
        nesting->has_key = 0;
        return is_closed && is_alone && in_range(part->size, part->count, conversion->anchor_count);
    }
    if (nesting->find == FCSL_ROS_NONE || nesting->depth > 0) {
        return 0;
    }
    if (part->code == FCSL_ROS_KEY) {
        nesting->has_key = 1;
        return part->first < conversion->name_count;
    }
    const int is_end = part->first == nesting->find && nesting->counts == nesting->find_counts && nesting->has_key;
    nesting->find = FCSL_ROS_NONE;
    return is_end;
}

/* REPEAT and END point at each other, something between them takes bytes, and every REPEAT has its COUNT before it, which is on
 * the same side of the beginning of a search. */
static int loop_valid(const fcsl_ros_reader_plan_t *conversion, uint32_t i, nesting_t *nesting)
{
    const fcsl_ros_part_t *part = &conversion->parts[i];
    if (part->code == FCSL_ROS_COUNT) {
        const int reads = part->first != FCSL_ROS_NONE;
        return nesting->counts++ < FCSL_ROS_DEPTH_MAX &&
               (!reads || (nesting->depth == 0 && part->first < conversion->anchor_count));
    }
    if (part->code == FCSL_ROS_REPEAT) {
        const uint32_t outside = nesting->find == FCSL_ROS_NONE ? 0u : nesting->find_counts;
        if (nesting->counts <= outside || nesting->depth == nesting->counts || part->first <= i + 1u ||
            part->first >= conversion->part_count || conversion->parts[part->first].code != FCSL_ROS_END ||
            conversion->parts[part->first].first != i || conversion->parts[i + 1u].code == FCSL_ROS_REPEAT ||
            conversion->parts[i + 1u].code == FCSL_ROS_END) {
            return 0;
        }
        nesting->counts_at[nesting->depth] = nesting->counts;
        nesting->repeats[nesting->depth++] = i;
        return 1;
    }
    if (nesting->depth == 0 || nesting->repeats[nesting->depth - 1u] != part->first ||
        nesting->counts_at[nesting->depth - 1u] != nesting->counts) {
        return 0;
    }
    nesting->depth--;
    nesting->counts--;
    return 1;
}

/* Whether a part within a search sets only anchors that the search clears: else one would point into an old message. */
static int anchors_cleared(const fcsl_ros_reader_plan_t *conversion, const fcsl_ros_part_t *part, uint32_t find)
{
    const fcsl_ros_part_t *search = &conversion->parts[find];
    if (part->code == FCSL_ROS_SEQUENCE) {
        for (uint32_t i = 0; i < part->count; i++) {
            if (conversion->picks[part->first + i].anchor - search->size >= search->count) {
                return 0;
            }
        }
        return 1;
    }
    const int has_anchor = part->code == FCSL_ROS_BLOCK || part->code == FCSL_ROS_COUNT;
    const uint32_t anchor = part->code == FCSL_ROS_CHOICE ? part->size : has_anchor ? part->first : FCSL_ROS_NONE;
    return anchor == FCSL_ROS_NONE || anchor - search->size < search->count;
}

int fcsl_ros_walk_valid(const fcsl_ros_reader_plan_t *conversion)
{
    nesting_t nesting = {.find = FCSL_ROS_NONE};
    if (conversion->part_count > FCSL_ROS_PARTS_MAX || conversion->name_count > FCSL_ROS_NAMES_MAX ||
        conversion->anchor_count > FCSL_ROS_ANCHORS_MAX) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->part_count; i++) {
        const fcsl_ros_part_t *part = &conversion->parts[i];
        int valid = 0;
        if (part->code == FCSL_ROS_COUNT || part->code == FCSL_ROS_REPEAT || part->code == FCSL_ROS_END) {
            valid = loop_valid(conversion, i, &nesting);
        } else if (part->code == FCSL_ROS_FIND || part->code == FCSL_ROS_KEY || part->code == FCSL_ROS_FOUND) {
            valid = search_valid(conversion, i, &nesting);
        } else {
            valid = part_valid(conversion, part, nesting.depth > 0);
        }
        if (!valid || (nesting.find != FCSL_ROS_NONE && !anchors_cleared(conversion, part, nesting.find))) {
            return 0;
        }
    }
    return nesting.depth == 0 && nesting.counts == 0 && nesting.find == FCSL_ROS_NONE;
}
