/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_ros.h: composing messages. Input: number of patches (1), patches of the conversion (which table, then as fuzz.h says), a
 * time (8), the memory that the numbers are read from. Terms read what the caller vouches for, so their places stay.
 */
#include "fcsl/fcsl_ros.h"
#include "fuzz.h"

enum { TERMS = 6, ROWS = 6, CHOICES = 2, SEGMENTS = 5, TEXT_BYTES = 64, MEMORY_BYTES = 48 };

static const uint8_t TEXT[TEXT_BYTES] = {0, 1, 0, 0};
static const fcsl_ros_term_t TERM[TERMS] = {
    {1.0, 0, 0, FCSL_ROS_F64},  {2.0, 0, 8, FCSL_ROS_F64},  {-1.0, 0, 16, FCSL_ROS_I64},
    {1.0, 1, 24, FCSL_ROS_U64}, {1.0, 1, 32, FCSL_ROS_I32}, {1.0, 1, 36, FCSL_ROS_F32},
};
static const fcsl_ros_row_t ROW[ROWS] = {
    {0, 1, 12, FCSL_ROS_F64, 0, 0.0, 0.0, 0}, {1, 2, 20, FCSL_ROS_F32, 1, 0.5, 1.0, 0},
    {3, 1, 28, FCSL_ROS_U64, 0, 0.0, 0.0, 0}, {4, 1, 36, FCSL_ROS_U8, 0, 0.0, 0.0, 0},
    {2, 1, 40, FCSL_ROS_I64, 0, 0.0, 0.0, 0}, {0, 1, 48, FCSL_ROS_I16, 1, 1.0, 0.0, 0},
};

static const fcsl_ros_choice_t CHOICE[CHOICES] = {{{1.0, 0, 32, FCSL_ROS_U32}, 8, FCSL_ROS_TEXT, 0, 2},
                                                  {{1.0, 1, 32, FCSL_ROS_I32}, 52, FCSL_ROS_U16, 0, 2}};
static const char *const NAMES[] = {"on", "offline"};
static const int64_t NUMBERS[] = {-1, 70000};
static const fcsl_ros_segment_t SEGMENT[SEGMENTS] = {
    {0, 4, 1, 0}, {4, 8, 8, 0}, {12, 8, 1, 1}, {20, 8, 8, 0}, {28, 32, 4, 4}};

static void apply(const fcsl_ros_composer_t *composer, uint32_t size, bytes_t *bytes)
{
    uint8_t memory[MEMORY_BYTES + 8 * TEXT_BYTES] = {0}; /* a row has no more numbers than the text has bytes */
    const int64_t time_ns = (int64_t)take_number(bytes, 8);
    for (size_t i = 0; i < MEMORY_BYTES; i++) {
        memory[i] = (uint8_t)take_number(bytes, 1);
    }
    const uint8_t *const memories[] = {memory, memory};
    uint8_t *message = malloc(size);
    FUZZ_CHECK(message != NULL);
    uint32_t written = 0;
    const fcsl_ros_status_t status = fcsl_ros_compose(composer, memories, time_ns, message, &written);
    FUZZ_CHECK(status == FCSL_ROS_TAKEN || status == FCSL_ROS_RANGE || status == FCSL_ROS_NAN ||
               status == FCSL_ROS_STAMP || status == FCSL_ROS_UNKNOWN);
    FUZZ_CHECK(written <= size);
    free(message);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {""};
    fcsl_ros_row_t rows[ROWS];
    fcsl_ros_term_t terms[TERMS];
    fcsl_ros_choice_t choices[CHOICES];
    fcsl_ros_segment_t segments[SEGMENTS];
    uint32_t numbers[] = {TEXT_BYTES, ROWS, TERMS, 2, 4, 0, 0};
    memcpy(rows, ROW, sizeof rows);
    memcpy(terms, TERM, sizeof terms);
    memcpy(choices, CHOICE, sizeof choices);
    memcpy(segments, SEGMENT, sizeof segments);
    const uint64_t patches = take_number(&bytes, 1) % 8u;
    for (uint64_t i = 0; i < patches; i++) {
        const uint64_t which = take_number(&bytes, 1) % 5u;
        if (which == 0) {
            patch_words(&bytes, rows, sizeof rows, 1);
        } else if (which == 1) {
            terms[take_number(&bytes, 1) % TERMS].type = (uint8_t)(take_number(&bytes, 1) % 12u);
        } else if (which == 2) {
            patch_words(&bytes, numbers, sizeof numbers, 1);
        } else if (which == 3) {
            patch_words(&bytes, segments, sizeof segments, 1);
        } else {
            fcsl_ros_choice_t *choice = &choices[take_number(&bytes, 1) % CHOICES];
            const fcsl_ros_term_t index = choice->index;
            patch_words(&bytes, choice, sizeof *choice, 1);
            choice->index = (fcsl_ros_term_t){1.0, choice->index.anchor, index.offset, choice->index.type};
        }
    }
    fcsl_ros_composer_plan_t conversion = {
        .text = TEXT, .rows = rows, .terms = terms, .size = numbers[0] % (TEXT_BYTES + 1u)};
    conversion.row_count = numbers[1] % (ROWS + 1u);
    conversion.term_count = numbers[2] % (TERMS + 1u);
    conversion.memory_count = numbers[3] % 3u;
    conversion.stamp_offset = numbers[4];
    conversion.choices = choices;
    conversion.names = NAMES;
    conversion.numbers = NUMBERS;
    conversion.segments = segments;
    conversion.choice_count = numbers[5] % (CHOICES + 1u);
    conversion.name_count = 2;
    conversion.number_count = 2;
    conversion.segment_count = numbers[6] % (SEGMENTS + 1u);
    conversion.rows = conversion.row_count > 0 ? rows : NULL;
    conversion.terms = conversion.term_count > 0 ? terms : NULL;
    fcsl_ros_composer_t *composer = fcsl_ros_composer_new(&conversion, &error);
    FUZZ_CHECK((composer == NULL) == (error.text[0] != '\0'));
    if (composer != NULL) {
        apply(composer, conversion.size, &bytes);
    }
    fcsl_ros_composer_free(composer);
    return 0;
}
