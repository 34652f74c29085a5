/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_ros.h: reading messages. Input: number of patches (1), patches of the conversion's tables (which table, then as fuzz.h
 * says), a message. A conversion that is refused is none; whatever is accepted reads any message.
 */
#include "fuzz.h"
#include "ros_conversion.h"

enum { PARTS_MAX = COUNT_OF(PARTS), FIELDS_OFFSET = offsetof(fcsl_ros_reader_plan_t, part_count) };

/* Tables of one conversion, of exactly their size. */
typedef struct {
    fcsl_ros_part_t *parts;
    fcsl_ros_pick_t *picks;
    fcsl_ros_value_t *values;
    fcsl_ros_row_t *rows;
    fcsl_ros_term_t *terms;
    fcsl_ros_reader_plan_t conversion;
} tables_t;

static void *copy_of(const void *table, size_t size)
{
    void *copy = malloc(size);
    FUZZ_CHECK(copy != NULL);
    return memcpy(copy, table, size);
}

static void open_tables(tables_t *p, bytes_t *bytes)
{
    p->parts = copy_of(PARTS, sizeof PARTS);
    p->picks = copy_of(PICKS, sizeof PICKS);
    p->values = copy_of(ROW_VALUES, sizeof ROW_VALUES);
    p->rows = copy_of(ROWS, sizeof ROWS);
    p->terms = copy_of(TERMS, sizeof TERMS);
    p->conversion = CONVERSION;
    const uint64_t patches = take_number(bytes, 1) % 8u;
    for (uint64_t i = 0; i < patches; i++) {
        uint32_t numbers[] = {p->conversion.anchor_count, p->conversion.size, p->conversion.stamp_anchor,
                              p->conversion.stamp_offset};
        void *const tables[] = {p->parts, p->picks, p->values, p->rows, p->terms, numbers};
        const size_t sizes[] = {sizeof PARTS, sizeof PICKS, sizeof ROW_VALUES,
                                sizeof ROWS,  sizeof TERMS, sizeof numbers};
        const size_t which = (size_t)take_number(bytes, 1) % 6u;
        patch_words(bytes, tables[which], sizes[which], 1);
        p->conversion.anchor_count = numbers[0];
        p->conversion.size = numbers[1] & 0xffffu; /* the caller allocates it */
        p->conversion.stamp_anchor = numbers[2];
        p->conversion.stamp_offset = numbers[3];
    }
    p->conversion.parts = p->parts;
    p->conversion.picks = p->picks;
    p->conversion.values = p->values;
    p->conversion.rows = p->rows;
    p->conversion.terms = p->terms;
}

static void close_tables(tables_t *p)
{
    free(p->parts);
    free(p->picks);
    free(p->values);
    free(p->rows);
    free(p->terms);
}

static void read_message(fcsl_ros_reader_t *reader, uint32_t row_size, bytes_t *bytes)
{
    size_t size = bytes->left;
    uint8_t *message = take_copy(bytes, &size);
    uint8_t *row = malloc(row_size);
    uint8_t status[VALUES] = {0};
    int64_t stamp_ns = -1;
    const fcsl_ros_status_t whole = fcsl_ros_read(reader, message, size, row, status, &stamp_ns);
    FUZZ_CHECK(whole < FCSL_ROS_STATUSES && stamp_ns >= 0);
    for (uint32_t i = 0; i < VALUES; i++) {
        FUZZ_CHECK(whole == FCSL_ROS_TAKEN ? status[i] < FCSL_ROS_STATUSES : status[i] == whole);
    }
    free(row);
    free(message);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    bytes_t bytes = {data, size};
    fcsl_error_t error = {""};
    tables_t p;
    open_tables(&p, &bytes);
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(&p.conversion, &error);
    FUZZ_CHECK((reader == NULL) == (error.text[0] != '\0'));
    if (reader != NULL) {
        read_message(reader, p.conversion.size, &bytes);
    }
    fcsl_ros_reader_free(reader);
    close_tables(&p);
    return 0;
}
