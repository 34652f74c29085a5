/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_ros.h: reading messages. Input: which conversion and number of patches (1), patches of its tables (which table, then as fuzz.h
 * says), a message. A conversion that is refused is none; whatever is accepted reads any message.
 */
#include "fuzz.h"
#include "ros_conversion.h"

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
    const uint64_t head = take_number(bytes, 1);
    const fcsl_ros_reader_plan_t *plan = head < 128u ? &CONVERSION : &SEARCH;
    const uint64_t patches = head % 8u;
    p->parts = copy_of(plan->parts, plan->part_count * sizeof *plan->parts);
    p->picks = copy_of(plan->picks, plan->pick_count * sizeof *plan->picks);
    p->values = copy_of(plan->values, plan->value_count * sizeof *plan->values);
    p->rows = copy_of(plan->rows, plan->row_count * sizeof *plan->rows);
    p->terms = copy_of(plan->terms, plan->term_count * sizeof *plan->terms);
    p->conversion = *plan;
    for (uint64_t i = 0; i < patches; i++) {
        uint32_t numbers[] = {p->conversion.anchor_count, p->conversion.size, p->conversion.stamp_anchor,
                              p->conversion.stamp_offset};
        void *const tables[] = {p->parts, p->picks, p->values, p->rows, p->terms, numbers};
        const size_t sizes[] = {plan->part_count * sizeof *plan->parts,   plan->pick_count * sizeof *plan->picks,
                                plan->value_count * sizeof *plan->values, plan->row_count * sizeof *plan->rows,
                                plan->term_count * sizeof *plan->terms,   sizeof numbers};
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

static void read_message(fcsl_ros_reader_t *reader, const fcsl_ros_reader_plan_t *conversion, bytes_t *bytes)
{
    size_t size = bytes->left;
    uint8_t *message = take_copy(bytes, &size);
    uint8_t *row = malloc(conversion->size);
    uint8_t status[SEARCH_VALUES] = {0};
    int64_t stamp_ns = -1;
    const fcsl_ros_status_t whole = fcsl_ros_read(reader, message, size, row, status, &stamp_ns);
    FUZZ_CHECK(whole < FCSL_ROS_STATUSES && stamp_ns >= 0);
    for (uint32_t i = 0; i < conversion->value_count; i++) {
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
        read_message(reader, &p.conversion, &bytes);
    }
    fcsl_ros_reader_free(reader);
    close_tables(&p);
    return 0;
}
