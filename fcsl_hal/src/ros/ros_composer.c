/* SPDX-License-Identifier: Apache-2.0
 *
 * Composers: a message in which every constant is in place already, and what each tick puts into it.
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros.h"
#include "fcsl/fcsl_scalar.h"
#include "ros_number.h"

enum { LENGTH_BYTES = 4, ENCAPSULATION_BYTES = 4 };

struct fcsl_ros_composer {
    const fcsl_ros_composer_plan_t *conversion;
};

/* The next place for bytes of this alignment, which counts from behind the encapsulation. */
static uint32_t aligned(uint32_t at, uint32_t align)
{
    return at < ENCAPSULATION_BYTES ? at : at + (align - (at - ENCAPSULATION_BYTES) % align) % align;
}

static int choices_valid(const fcsl_ros_composer_plan_t *conversion)
{
    for (uint32_t i = 0; i < conversion->choice_count; i++) {
        const fcsl_ros_choice_t *choice = &conversion->choices[i];
        const int is_text = choice->type == FCSL_ROS_TEXT;
        const uint32_t whole = is_text ? conversion->name_count : conversion->number_count;
        const int has_index = choice->index.type == FCSL_ROS_I32 || choice->index.type == FCSL_ROS_U32;
        uint64_t bytes = fcsl_ros_scalar_size(choice->type);
        if (!has_index || choice->index.anchor >= conversion->memory_count || choice->count > whole ||
            choice->first > whole - choice->count) {
            return 0;
        }
        for (uint32_t j = 0; is_text && j < choice->count; j++) {
            const uint64_t text = LENGTH_BYTES + strlen(conversion->names[choice->first + j]) + 1u;
            bytes = text > bytes ? text : bytes;
        }
        if (bytes == 0 || bytes > conversion->size || choice->at > conversion->size - bytes) {
            return 0;
        }
    }
    return 1;
}

/* Whether the segments lie behind one another in the text, none begins before its place there, and the first does
 * not vary: a length can stand before those that do. */
static int segments_valid(const fcsl_ros_composer_plan_t *conversion)
{
    uint32_t end = 0;
    if (conversion->segment_count > 0 &&
        (conversion->segments[0].element > 0 || conversion->segments[0].size < ENCAPSULATION_BYTES)) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->segment_count; i++) {
        const fcsl_ros_segment_t *segment = &conversion->segments[i];
        const uint32_t align = segment->align;
        if ((align != 1u && align != 2u && align != 4u && align != 8u) || segment->offset > conversion->size ||
            segment->size > conversion->size - segment->offset || segment->offset < aligned(end, align) ||
            (i == 0 && segment->offset != 0)) {
            return 0;
        }
        end = segment->offset + segment->size;
    }
    return 1;
}

static int conversion_valid(const fcsl_ros_composer_plan_t *conversion)
{
    if (conversion->size == 0 || conversion->size > FCSL_ROS_MESSAGE_MAX ||
        !fcsl_ros_rows_valid(conversion->rows, conversion->row_count, conversion->term_count, conversion->size) ||
        !choices_valid(conversion) || !segments_valid(conversion)) {
        return 0;
    }
    for (uint32_t i = 0; i < conversion->term_count; i++) {
        if (conversion->terms[i].anchor >= conversion->memory_count ||
            fcsl_ros_scalar_size(conversion->terms[i].type) == 0) {
            return 0;
        }
    }
    return conversion->stamp_offset == FCSL_ROS_NONE ||
           (conversion->size >= 8u && conversion->stamp_offset <= conversion->size - 8u);
}

fcsl_ros_composer_t *fcsl_ros_composer_new(const fcsl_ros_composer_plan_t *conversion, fcsl_error_t *error)
{
    if (!conversion_valid(conversion)) {
        (void)fcsl_fail(error, "this plan of a message does not hold together");
        return NULL;
    }
    fcsl_ros_composer_t *composer = malloc(sizeof *composer);
    if (composer == NULL) {
        (void)fcsl_fail(error, "out of memory for the plan of a message");
        return NULL;
    }
    composer->conversion = conversion;
    return composer;
}

void fcsl_ros_composer_free(fcsl_ros_composer_t *composer)
{
    free(composer);
}

static fcsl_ros_status_t put_choice(const fcsl_ros_composer_plan_t *conversion, const fcsl_ros_choice_t *choice,
                                    const uint8_t *const *memories, uint8_t *cdr)
{
    uint32_t index = 0;
    memcpy(&index, memories[choice->index.anchor] + choice->index.offset, sizeof index); /* below 0 is beyond all */
    if (index >= choice->count) {
        return FCSL_ROS_UNKNOWN;
    }
    if (choice->type != FCSL_ROS_TEXT) {
        const uint64_t number = (uint64_t)conversion->numbers[choice->first + index];
        memcpy(cdr + choice->at, &number, fcsl_ros_scalar_size(choice->type)); /* little-endian */
        return FCSL_ROS_TAKEN;
    }
    const char *text = conversion->names[choice->first + index];
    const uint32_t bytes = (uint32_t)strlen(text) + 1u;
    fcsl_put_u32(cdr + choice->at, bytes);
    memcpy(cdr + choice->at + LENGTH_BYTES, text, bytes);
    return FCSL_ROS_TAKEN;
}

/* Closes up what is shorter than its room. Nothing moves to a higher place, so no byte is overwritten before it was moved. */
static fcsl_ros_status_t close_up(const fcsl_ros_composer_plan_t *conversion, uint8_t *cdr, uint32_t *size)
{
    uint32_t end = 0;
    for (uint32_t i = 0; i < conversion->segment_count; i++) {
        const fcsl_ros_segment_t *segment = &conversion->segments[i];
        uint64_t bytes = segment->size;
        if (segment->element > 0) {
            bytes = (uint64_t)fcsl_get_u32(cdr + end - LENGTH_BYTES) * segment->element;
            if (bytes > segment->size) {
                return FCSL_ROS_RANGE;
            }
        }
        if (bytes == 0) {
            continue; /* an empty sequence is not aligned */
        }
        const uint32_t to = aligned(end, segment->align);
        memset(cdr + end, 0, to - end);
        memmove(cdr + to, cdr + segment->offset, (size_t)bytes);
        end = to + (uint32_t)bytes;
    }
    *size = end;
    return FCSL_ROS_TAKEN;
}

fcsl_ros_status_t fcsl_ros_compose(const fcsl_ros_composer_t *composer, const uint8_t *const *memories, int64_t time_ns,
                                   uint8_t *cdr, uint32_t *size)
{
    const fcsl_ros_composer_plan_t *conversion = composer->conversion;
    memcpy(cdr, conversion->text, conversion->size);
    *size = conversion->size;
    if (conversion->stamp_offset != FCSL_ROS_NONE) {
        if (time_ns < 0 || time_ns / 1000000000 > INT32_MAX) {
            return FCSL_ROS_STAMP;
        }
        fcsl_put_u32(cdr + conversion->stamp_offset, (uint32_t)(time_ns / 1000000000));
        fcsl_put_u32(cdr + conversion->stamp_offset + 4u, (uint32_t)(time_ns % 1000000000));
    }
    for (uint32_t i = 0; i < conversion->row_count; i++) {
        const fcsl_ros_status_t status = fcsl_ros_row_apply(&conversion->rows[i], conversion->terms, memories, 1, cdr);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
    }
    for (uint32_t i = 0; i < conversion->choice_count; i++) {
        const fcsl_ros_status_t status = put_choice(conversion, &conversion->choices[i], memories, cdr);
        if (status != FCSL_ROS_TAKEN) {
            return status;
        }
    }
    return conversion->segment_count > 0 ? close_up(conversion, cdr, size) : FCSL_ROS_TAKEN;
}
