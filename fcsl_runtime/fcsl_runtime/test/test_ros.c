/* SPDX-License-Identifier: Apache-2.0
 *
 * Reading ROS 2 messages that come from anybody: every length, random bytes, lengths of 4 billion. Each message ends where
 * its page does, and the next page cannot be read, so that one byte too many ends the test. Conversions that do not hold together
 * are refused, and nothing is allocated while messages are read, delivered or composed.
 * Argument: the fixture library.
 */
#define _GNU_SOURCE
#include <string.h>
#include <sys/mman.h>
#include <unistd.h>

#include "fcsl/fcsl_cdr.h"
#include "fcsl/fcsl_sample_input.h"
#include "fcsl_allocations.h"
#include "fcsl_check.h"
#include "ros_conversion.h"

enum { PAGE = 4096, MUTATIONS = 200000 };

typedef struct {
    double position;
    double v[3];
    uint8_t armed;
    int32_t mode;
} row_t;

static uint64_t state = 42;

static uint32_t random_number(uint32_t below)
{
    state = state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(state >> 33) % below;
}

/* Two pages, of which the second cannot be touched. */
static uint8_t *guarded_page(void)
{
    uint8_t *pages = mmap(NULL, 2 * PAGE, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0);
    CHECK(pages != MAP_FAILED && mprotect(pages + PAGE, PAGE, PROT_NONE) == 0);
    return pages;
}

static fcsl_ros_status_t read_at_the_end(fcsl_ros_reader_t *reader, uint8_t *page, const uint8_t *bytes, size_t size,
                                         row_t *row, uint8_t *status)
{
    int64_t stamp_ns = 0;
    memcpy(page + PAGE - size, bytes, size);
    return fcsl_ros_read(reader, page + PAGE - size, size, (uint8_t *)row, status, &stamp_ns);
}

static void test_reading(fcsl_ros_reader_t *reader, uint8_t *page)
{
    uint8_t bytes[MESSAGE_MAX];
    uint8_t status[VALUES];
    row_t row;
    const size_t size = make_message(bytes);
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_TAKEN);
    CHECK(status[0] == FCSL_ROS_TAKEN && row.position == 11.0);
    CHECK(status[1] == FCSL_ROS_TAKEN && row.v[0] == 1.5 && row.v[1] == -2.5 && row.v[2] == 0.0);
    CHECK(1.0 / row.v[2] > 0.0); /* -1 * -0 */
    CHECK(status[2] == FCSL_ROS_TAKEN && row.armed == 1 && row.mode == 4); /* 6 * 0.5 + 1 */

    for (size_t cut = 0; cut < size; cut++) {
        const fcsl_ros_status_t whole = read_at_the_end(reader, page, bytes, cut, &row, status);
        CHECK(whole == FCSL_ROS_TRUNCATED && status[0] == whole && status[1] == whole && status[2] == whole);
    }
    memset(bytes + size, 0xff, 8);
    CHECK(read_at_the_end(reader, page, bytes, size + 8, &row, status) == FCSL_ROS_TAKEN);
}

/* Each 32-bit word in turn becomes a length that no message can have; then single values that must not be taken. */
static void test_wrong_values(fcsl_ros_reader_t *reader, uint8_t *page)
{
    static const uint32_t huge[] = {0xffffffffu, 0x80000000u, 0x7fffffffu, 0x20000001u, 0xfffffff9u};
    uint8_t bytes[MESSAGE_MAX];
    uint8_t status[VALUES];
    row_t row;
    const size_t size = make_message(bytes);
    for (size_t at = FCSL_CDR_ENCAPSULATION_BYTES; at + 4 <= size; at += 4) {
        for (uint32_t i = 0; i < COUNT_OF(huge); i++) {
            (void)make_message(bytes);
            memcpy(bytes + at, &huge[i], sizeof huge[i]);
            (void)read_at_the_end(reader, page, bytes, size, &row, status);
        }
    }
    (void)make_message(bytes);
    bytes[1] = 0; /* big-endian */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_ENCODING);
    bytes[1] = 3; /* a parameter list */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_ENCODING);
    (void)make_message(bytes);
    bytes[20] = 'x'; /* the NUL of "base" */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_MALFORMED);
    (void)make_message(bytes);
    memset(bytes + 8, 0xff, 4); /* nanoseconds */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_STAMP);
    (void)make_message(bytes);
    bytes[armed_at] = 2;
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_TAKEN);
    CHECK(status[0] == FCSL_ROS_TAKEN && status[1] == FCSL_ROS_TAKEN && status[2] == FCSL_ROS_RANGE && row.mode == 0);
    (void)make_message(bytes);
    bytes[armed_at + 2] = 7; /* a mode of 4.5 */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_TAKEN && status[2] == FCSL_ROS_RANGE);
    (void)make_message(bytes);
    memset(bytes + size - 8, 0xff, 8); /* v[2] */
    CHECK(read_at_the_end(reader, page, bytes, size, &row, status) == FCSL_ROS_TAKEN);
    CHECK(status[1] == FCSL_ROS_NAN && row.v[0] == 0.0 && row.v[1] == 0.0 && row.v[2] == 0.0);
}

static void test_random_bytes(fcsl_ros_reader_t *reader, uint8_t *page)
{
    uint8_t bytes[MESSAGE_MAX];
    uint8_t status[VALUES];
    uint32_t seen[FCSL_ROS_STATUSES] = {0};
    row_t row;
    for (uint32_t i = 0; i < MUTATIONS; i++) {
        size_t size = make_message(bytes);
        const uint32_t changes = 1 + random_number(6);
        for (uint32_t j = 0; j < changes; j++) {
            bytes[4 + random_number((uint32_t)size - 4)] = (uint8_t)random_number(random_number(2) ? 8 : 256);
        }
        if (random_number(4) == 0) {
            size = random_number((uint32_t)size + 1);
        }
        const fcsl_ros_status_t whole = read_at_the_end(reader, page, bytes, size, &row, status);
        CHECK(whole <= FCSL_ROS_SHAPE);
        for (uint32_t j = 0; j < VALUES; j++) {
            CHECK(whole == FCSL_ROS_TAKEN ? status[j] == FCSL_ROS_TAKEN || status[j] >= FCSL_ROS_SHAPE
                                          : status[j] == whole);
            seen[status[j]]++;
        }
    }
    CHECK(seen[FCSL_ROS_TAKEN] > 0 && seen[FCSL_ROS_TRUNCATED] > 0 && seen[FCSL_ROS_MALFORMED] > 0);
    CHECK(seen[FCSL_ROS_SHAPE] > 0 && seen[FCSL_ROS_RANGE] > 0);
}

static int conversion_is_refused(const fcsl_ros_reader_plan_t *conversion)
{
    fcsl_error_t error = {{0}};
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(conversion, &error);
    fcsl_ros_reader_free(reader);
    return reader == NULL && error.text[0] != '\0';
}

#define WRONG(table, field, index, member, value)                                                                      \
    do {                                                                                                               \
        memcpy(copy_of_##field, table, sizeof copy_of_##field);                                                        \
        copy_of_##field[index].member = (value);                                                                       \
        fcsl_ros_reader_plan_t conversion = CONVERSION;                                                                \
        conversion.field = copy_of_##field;                                                                            \
        CHECK(conversion_is_refused(&conversion));                                                                     \
    } while (0)

#define WRONG_SEARCH(table, field, index, member, value)                                                               \
    do {                                                                                                               \
        memcpy(copy_of_##field, table, sizeof copy_of_##field);                                                        \
        copy_of_##field[index].member = (value);                                                                       \
        fcsl_ros_reader_plan_t conversion = SEARCH;                                                                    \
        conversion.field = copy_of_##field;                                                                            \
        CHECK(conversion_is_refused(&conversion));                                                                     \
    } while (0)

static void test_plans_of_searches(void)
{
    fcsl_ros_part_t copy_of_parts[COUNT_OF(SEARCH_PARTS)];
    fcsl_ros_pick_t copy_of_picks[COUNT_OF(SEARCH_PICKS)];
    fcsl_ros_row_t copy_of_rows[COUNT_OF(SEARCH_ROWS)];
    fcsl_ros_value_t copy_of_values[SEARCH_VALUES];
    WRONG_SEARCH(SEARCH_PARTS, parts, 1, size, 6);              /* an anchor that is none */
    WRONG_SEARCH(SEARCH_PARTS, parts, 1, count, 4);             /* names that there are not */
    WRONG_SEARCH(SEARCH_PARTS, parts, 4, first, 10);            /* a search without its end */
    WRONG_SEARCH(SEARCH_PARTS, parts, 4, count, 3);             /* it clears anchors that there are not */
    WRONG_SEARCH(SEARCH_PARTS, parts, 4, size, 5);              /* it does not clear what it sets */
    WRONG_SEARCH(SEARCH_PARTS, parts, 5, code, FCSL_ROS_STRING); /* without a key: a turn that takes nothing */
    WRONG_SEARCH(SEARCH_PARTS, parts, 5, first, 3);
    WRONG_SEARCH(SEARCH_PARTS, parts, 8, code, FCSL_ROS_KEY);   /* a key in a loop */
    WRONG_SEARCH(SEARCH_PARTS, parts, 8, code, FCSL_ROS_CHOICE);
    WRONG_SEARCH(SEARCH_PARTS, parts, 11, first, 3);
    WRONG_SEARCH(SEARCH_PARTS, parts, 14, code, FCSL_ROS_FIND); /* a search in a loop */
    WRONG_SEARCH(SEARCH_PARTS, parts, 15, first, 5);            /* a length in a loop */
    WRONG_SEARCH(SEARCH_PICKS, picks, 0, element, 0);           /* its value expects fewer */
    WRONG_SEARCH(SEARCH_PICKS, picks, 0, count, 3);
    WRONG_SEARCH(SEARCH_ROWS, rows, 4, type, FCSL_ROS_F32);     /* an index is an integer */
    WRONG_SEARCH(SEARCH_ROW_VALUES, values, 0, limited, 0);
    WRONG_SEARCH(SEARCH_ROW_VALUES, values, 1, limited, 1);
    WRONG_SEARCH(SEARCH_ROW_VALUES, values, 4, choice_count, 3);
    WRONG_SEARCH(SEARCH_ROW_VALUES, values, 4, size, 3);
}

typedef struct {
    double position[4];
    uint32_t length;
    uint32_t items;
    uint32_t frame;
    int32_t mode;
} search_row_t;

static void test_searches(void)
{
    fcsl_error_t error;
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(&SEARCH, &error);
    uint8_t message[MESSAGE_MAX];
    uint8_t status[SEARCH_VALUES];
    search_row_t row;
    int64_t stamp_ns = 0;
    const size_t size = make_message(message);
    CHECK(reader != NULL);
    counting = 1;
    CHECK(fcsl_ros_read(reader, message, size, (uint8_t *)&row, status, &stamp_ns) == FCSL_ROS_TAKEN);
    counting = 0;
    CHECK(allocations == 0 && row.position[2] == 12.0 && row.position[3] == 0.0 && row.length == 3);
    CHECK(row.items == 2 && row.frame == 1 && row.mode == 1);
    message[armed_at + 2] = 7;
    message[16] = 'c'; /* of "base" */
    CHECK(fcsl_ros_read(reader, message, size, (uint8_t *)&row, status, &stamp_ns) == FCSL_ROS_TAKEN);
    CHECK(status[3] == FCSL_ROS_UNKNOWN && status[4] == FCSL_ROS_UNKNOWN && status[2] == FCSL_ROS_TAKEN);
    for (size_t i = 0; i < size; i++) {
        uint8_t cut[MESSAGE_MAX];
        memcpy(cut, message, size);
        CHECK(fcsl_ros_read(reader, cut, i, (uint8_t *)&row, status, &stamp_ns) != FCSL_ROS_TAKEN);
        cut[i] ^= 0x55u;
        const fcsl_ros_status_t whole = fcsl_ros_read(reader, cut, size, (uint8_t *)&row, status, &stamp_ns);
        CHECK(whole != FCSL_ROS_TAKEN || status[0] == FCSL_ROS_TAKEN || status[0] == FCSL_ROS_SHAPE ||
              status[0] == FCSL_ROS_NAN);
    }
    fcsl_ros_reader_free(reader);
}

/* A message with a string that is chosen and a list of up to three doubles: a block, "on" or "offline", f64[], u8. */
static void test_messages_of_different_lengths(void)
{
    static const uint8_t text[68] = {0, 1, 0, 0, 7, 0, 0, 0, 8, 0, 0, 0, [20] = 3, [52] = 9};
    static const fcsl_ros_term_t terms[] = {{1.0, 0, 0, FCSL_ROS_U32}, {1.0, 0, 8, FCSL_ROS_F64}};
    static const fcsl_ros_row_t rows[] = {{0, 1, 20, FCSL_ROS_U32, 0, 0, 0, 0}, {1, 1, 28, FCSL_ROS_F64, 0, 0, 0, 2}};
    static const fcsl_ros_choice_t choices[] = {{{1.0, 0, 4, FCSL_ROS_I32}, 8, FCSL_ROS_TEXT, 0, 2}};
    static const char *const names[] = {"on", "offline"};
    fcsl_ros_segment_t segments[] = {{0, 4, 1, 0},  {4, 8, 8, 0},   {12, 8, 1, 1},
                                     {20, 4, 4, 0}, {28, 24, 8, 8}, {52, 1, 1, 0}};
    const fcsl_ros_composer_plan_t conversion = {.text = text,
                                                 .rows = rows,
                                                 .terms = terms,
                                                 .choices = choices,
                                                 .names = names,
                                                 .segments = segments,
                                                 .size = 53,
                                                 .row_count = 2,
                                                 .term_count = 2,
                                                 .choice_count = 1,
                                                 .name_count = 2,
                                                 .segment_count = 6,
                                                 .memory_count = 1,
                                                 .stamp_offset = FCSL_ROS_NONE};
    struct {
        uint32_t count;
        int32_t index;
        double numbers[3];
    } memory = {2, 0, {1.0, 2.0, 3.0}};
    const uint8_t *const memories[] = {(const uint8_t *)&memory};
    uint8_t out[sizeof text];
    uint32_t size = 0;
    double number = 0.0;
    fcsl_error_t error;
    fcsl_ros_composer_t *composer = fcsl_ros_composer_new(&conversion, &error);
    CHECK(composer != NULL);
    CHECK(fcsl_ros_compose(composer, memories, 0, out, &size) == FCSL_ROS_TAKEN);
    memcpy(&number, out + 28, sizeof number); /* behind "on\0", a byte of padding and the length */
    CHECK(size == 37 && out[8] == 3 && memcmp(out + 12, "on", 3) == 0 && out[16] == 2 && number == 2.0 && out[36] == 9);
    memory.count = 0;
    memory.index = 1;
    CHECK(fcsl_ros_compose(composer, memories, 0, out, &size) == FCSL_ROS_TAKEN && size == 25);
    memory.count = 4;
    CHECK(fcsl_ros_compose(composer, memories, 0, out, &size) == FCSL_ROS_RANGE);
    memory.count = UINT32_MAX / 8u + 2u; /* times 8: wraps to 8 in 32 bits */
    CHECK(fcsl_ros_compose(composer, memories, 0, out, &size) == FCSL_ROS_RANGE);
    memory.index = -1;
    CHECK(fcsl_ros_compose(composer, memories, 0, out, &size) == FCSL_ROS_UNKNOWN);
    fcsl_ros_composer_free(composer);
    segments[3].offset = 19; /* over the one before */
    CHECK(fcsl_ros_composer_new(&conversion, &error) == NULL);
    segments[3].offset = 20;
    segments[0].element = 1; /* without a length before it */
    CHECK(fcsl_ros_composer_new(&conversion, &error) == NULL);
}

static void test_plans(void)
{
    fcsl_ros_part_t copy_of_parts[COUNT_OF(PARTS)];
    fcsl_ros_term_t copy_of_terms[COUNT_OF(TERMS)];
    fcsl_ros_row_t copy_of_rows[COUNT_OF(ROWS)];
    fcsl_ros_value_t copy_of_values[VALUES];
    fcsl_ros_pick_t copy_of_picks[COUNT_OF(PICKS)];
    WRONG(PARTS, parts, 0, code, 99);
    WRONG(PARTS, parts, 0, align, 3);
    WRONG(PARTS, parts, 8, size, 0);        /* a loop that takes no bytes */
    WRONG(PARTS, parts, 8, first, 0);       /* an anchor in a loop */
    WRONG(PARTS, parts, 8, code, FCSL_ROS_COUNT); /* a count in a loop without its repeat */
    WRONG(PARTS, parts, 7, first, 18);
    WRONG(PARTS, parts, 10, first, 11);
    WRONG(PARTS, parts, 7, code, FCSL_ROS_END);
    WRONG(PARTS, parts, 4, code, FCSL_ROS_STRING);
    WRONG(PARTS, parts, 3, count, 2);
    WRONG(PARTS, parts, 2, count, 2);
    WRONG(PARTS, parts, 20, first, 4);
    WRONG(PARTS, parts, 20, first, 0);      /* an anchor twice */
    WRONG(PARTS, parts, 20, size, 16);      /* a term beyond its block */
    WRONG(PICKS, picks, 0, name, 1);
    WRONG(TERMS, terms, 0, anchor, 4);
    WRONG(TERMS, terms, 0, offset, 1);
    WRONG(TERMS, terms, 0, type, 11);
    WRONG(ROWS, rows, 0, offset, 33);
    WRONG(ROWS, rows, 0, term_count, 0);
    WRONG(ROWS, rows, 4, first_term, 5);
    WRONG(ROWS, rows, 2, more, 2);          /* beyond its block */
    WRONG(ROWS, rows, 2, more, UINT32_MAX);
    WRONG(ROWS, rows, 2, term_count, 2);    /* of several terms there is one number */
    WRONG(ROW_VALUES, values, 2, size, 9);
    WRONG(ROW_VALUES, values, 2, row_count, 3);
    WRONG(ROW_VALUES, values, 0, guard_count, 1);
    fcsl_ros_reader_plan_t conversion = CONVERSION;
    conversion.stamp_offset = 1;
    CHECK(conversion_is_refused(&conversion));
}

static void test_many(fcsl_ros_reader_t *reader)
{
    uint8_t buffer[3 * MESSAGE_MAX];
    uint8_t status[4][VALUES];
    row_t rows[4];
    int64_t stamps[4];
    const int64_t size = (int64_t)make_message(buffer);
    memcpy(buffer + size, buffer, (size_t)size);
    const int64_t offsets[4] = {0, size, -1, size + 1};
    const int64_t sizes[4] = {size, size, size, size};
    fcsl_ros_read_many(reader, buffer, 2 * (size_t)size, offsets, sizes, 4, (uint8_t *)rows, status[0], stamps);
    for (int i = 0; i < 4; i++) {
        CHECK(status[i][1] == (i < 2 ? FCSL_ROS_TAKEN : FCSL_ROS_TRUNCATED));
        CHECK(stamps[i] == (i < 2 ? 12000000034 : 0) && rows[i].v[0] == (i < 2 ? 1.5 : 0.0));
    }
}

/* std_msgs/Float64MultiArray, the gyro of the fixture: 3 numbers. */
static void test_sample_input(const char *library)
{
    static const fcsl_ros_part_t parts[] = {{FCSL_ROS_BLOCK, 8, 8, 0, 0}, {FCSL_ROS_SEQUENCE, 8, 8, 0, 1}};
    static const fcsl_ros_pick_t picks[] = {{1, 3, 0, FCSL_ROS_NONE}};
    static const fcsl_ros_term_t terms[] = {
        {1.0, 1, 0, FCSL_ROS_F64}, {1.0, 1, 8, FCSL_ROS_F64}, {1.0, 1, 16, FCSL_ROS_F64}};
    static const fcsl_ros_row_t rows[] = {
        {0, 1, 0, FCSL_ROS_F64, 0, 0, 0, 0}, {1, 1, 8, FCSL_ROS_F64, 0, 0, 0, 0}, {2, 1, 16, FCSL_ROS_F64, 0, 0, 0, 0}};
    static const fcsl_ros_value_t values[] = {{0, 24, 0, 3, 0, 0, 0, 0, 0, 0}};
    const fcsl_ros_reader_plan_t conversion = {.parts = parts,
                                               .picks = picks,
                                               .values = values,
                                               .rows = rows,
                                               .terms = terms,
                                               .part_count = 2,
                                               .pick_count = 1,
                                               .value_count = 1,
                                               .row_count = 3,
                                               .term_count = 3,
                                               .anchor_count = 2,
                                               .size = 24};
    static const uint32_t channels[] = {0, 1};
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, "fixture", NULL, &error);
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(&conversion, &error);
    CHECK(run != NULL && reader != NULL);
    CHECK(fcsl_sample_input_new(run, reader, channels, 2, &error) == NULL);
    CHECK(fcsl_sample_input_new(run, reader, channels + 1, 1, &error) == NULL);
    fcsl_sample_input_t *input = fcsl_sample_input_new(run, reader, channels, 1, &error);
    CHECK(input != NULL && fcsl_run_attach(run, &error) == 0);

    uint8_t bytes[MESSAGE_MAX];
    counting = 1;
    for (uint32_t i = 0; i < 2000; i++) {
        const int64_t now_ns = 1000000000 + (int64_t)i * 10000000;
        fcsl_cdr_t cdr;
        fcsl_cdr_begin(&cdr, bytes, sizeof bytes);
        fcsl_cdr_u32(&cdr, (uint32_t)(now_ns / 1000000000));
        fcsl_cdr_u32(&cdr, (uint32_t)(now_ns % 1000000000));
        fcsl_cdr_u32(&cdr, 2 + i % 2);
        for (uint32_t j = 0; j < 3; j++) {
            put_double(&cdr, i + 0.5 * j);
        }
        const size_t size = fcsl_cdr_end(&cdr) - (i % 2 == 0 ? 8u : 0u);
        CHECK(fcsl_sample_input_deliver(input, bytes, size, now_ns + 1, NULL) == i % 2);
        CHECK(fcsl_sample_input_deliver(input, bytes, size, now_ns + 1, NULL) == 0);
        CHECK(fcsl_run_step(run, 1, &error) == 0);
    }
    counting = 0;
    CHECK(allocations == 0);
    const uint64_t *counts = fcsl_sample_input_counts(input);
    CHECK(counts[FCSL_ROS_TAKEN] == 1000 && counts[FCSL_ROS_REPEATED] == 1000 && counts[FCSL_ROS_SHAPE] == 2000);
    fcsl_sample_input_free(input);
    fcsl_ros_reader_free(reader);
    CHECK(fcsl_run_close(run, &error) == 0);
}

static void test_composing(void)
{
    static const uint8_t text[20] = {0, 1, 0, 0, 1, 2, 3, 4, 5, 6, 7, 8};
    static const fcsl_ros_term_t terms[] = {{2.0, 1, 0, FCSL_ROS_F64}, {-1.0, 0, 8, FCSL_ROS_I32}};
    static const fcsl_ros_row_t rows[] = {{0, 2, 12, FCSL_ROS_F64, 0, 0, 0, 0}};
    fcsl_ros_composer_plan_t conversion = {.text = text,
                                           .rows = rows,
                                           .terms = terms,
                                           .size = sizeof text,
                                           .row_count = 1,
                                           .term_count = 2,
                                           .memory_count = 2,
                                           .stamp_offset = 4};
    fcsl_error_t error;
    fcsl_ros_composer_t *composer = fcsl_ros_composer_new(&conversion, &error);
    CHECK(composer != NULL);
    const double number = 1.25;
    const int32_t whole[3] = {0, 0, 7};
    const uint8_t *const memories[] = {(const uint8_t *)whole, (const uint8_t *)&number};
    uint8_t out[sizeof text];
    double sum = 0.0;
    counting = 1;
    uint32_t size = 0;
    CHECK(fcsl_ros_compose(composer, memories, 3000000005, out, &size) == FCSL_ROS_TAKEN && size == sizeof text);
    counting = 0;
    memcpy(&sum, out + 12, sizeof sum);
    CHECK(allocations == 0 && sum == -4.5 && out[4] == 3 && out[8] == 5 && out[1] == 1);
    CHECK(fcsl_ros_compose(composer, memories, -1, out, &size) == FCSL_ROS_STAMP);
    const int64_t late_ns = (int64_t)INT32_MAX * 1000000000 + 1000000000;
    CHECK(fcsl_ros_compose(composer, memories, late_ns, out, &size) == FCSL_ROS_STAMP);
    fcsl_ros_composer_free(composer);
    conversion.stamp_offset = 13;
    CHECK(fcsl_ros_composer_new(&conversion, &error) == NULL);
    conversion.stamp_offset = 4;
    conversion.memory_count = 1;
    CHECK(fcsl_ros_composer_new(&conversion, &error) == NULL);

    /* Nothing but constants and a stamp: no tables at all. */
    const fcsl_ros_composer_plan_t constant = {.text = text, .size = sizeof text, .stamp_offset = 4};
    composer = fcsl_ros_composer_new(&constant, &error);
    CHECK(composer != NULL && fcsl_ros_compose(composer, NULL, 7000000000, out, &size) == FCSL_ROS_TAKEN &&
          out[4] == 7);
    fcsl_ros_composer_free(composer);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2 && sizeof(row_t) == 40 && sizeof(search_row_t) == 48);
    fcsl_error_t error = {{0}};
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(&CONVERSION, &error);
    CHECK(reader != NULL);
    uint8_t *page = guarded_page();
    test_reading(reader, page);
    test_wrong_values(reader, page);
    test_random_bytes(reader, page);
    test_many(reader);
    fcsl_ros_reader_free(reader);
    test_plans();
    test_plans_of_searches();
    test_searches();
    test_messages_of_different_lengths();
    test_sample_input(argv[1]);
    test_composing();
    return 0;
}
