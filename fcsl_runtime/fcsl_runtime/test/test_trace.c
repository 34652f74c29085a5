/* SPDX-License-Identifier: Apache-2.0
 *
 * Traces, values of fields that are fed, sets that are checked first. Argument: the fixture library.
 */
#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_run.h"
#include "fcsl_check.h"

enum { CAPACITY = 7, TICKS = 40 };

static fcsl_run_t *open_run(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    CHECK(run != NULL);
    return run;
}

static uint32_t find_writable(const fcsl_machine_t *machine)
{
    for (uint32_t i = 0; i < machine->field_count; i++) {
        if ((machine->fields[i].flags & FCSL_FIELD_WRITABLE) != 0 && machine->fields[i].type == FCSL_F64) {
            return i;
        }
    }
    CHECK(0);
    return 0;
}

/* Rows are what the struct held after each tick, however the ticks were run; the oldest are written over. */
static void test_rows(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_run(library);
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    const uint8_t *data = fcsl_run_data(run);
    const fcsl_range_t ranges[] = {{machine->tick_offset, 8}, {0, machine->size}};
    const size_t row = 8u + machine->size;
    fcsl_trace_t *trace = fcsl_run_trace_begin(run, ranges, 2, CAPACITY, &error);
    fcsl_trace_t *all = fcsl_run_trace_begin(run, ranges + 1, 1, TICKS, &error);
    CHECK(trace != NULL && all != NULL);
    uint8_t *expected = malloc(TICKS * row);
    uint8_t *rows = malloc(TICKS * row);
    CHECK(expected != NULL && rows != NULL);
    for (uint64_t i = 0; i < TICKS; i++) {
        CHECK(fcsl_run_trace_rows(trace) == i);
        CHECK(i % 3u == 0 ? fcsl_run_step(run, 1, &error) == 0 : fcsl_run_step_once(run, &error) == (int64_t)i + 1);
        memcpy(expected + i * row, data + machine->tick_offset, 8);
        memcpy(expected + i * row + 8, data, machine->size);
        for (uint64_t kept = 0; kept <= CAPACITY && kept <= i + 1u; kept++) {
            const int status = fcsl_run_trace_read(trace, i + 1u - kept, kept, rows, &error);
            CHECK(status == 0 && memcmp(rows, expected + (i + 1u - kept) * row, kept * row) == 0);
        }
    }
    CHECK(fcsl_run_trace_read(trace, TICKS - CAPACITY - 1, 1, rows, &error) != 0);
    CHECK(fcsl_run_trace_read(trace, TICKS, 1, rows, &error) != 0);
    CHECK(fcsl_run_trace_read(trace, TICKS - 1, UINT64_MAX, rows, &error) != 0);
    CHECK(fcsl_run_trace_read(all, 0, TICKS, rows, &error) == 0);
    for (uint64_t i = 0; i < TICKS; i++) {
        CHECK(memcmp(rows + i * machine->size, expected + i * row + 8, machine->size) == 0);
    }
    fcsl_run_trace_end(run, trace);
    CHECK(fcsl_run_step(run, 1, &error) == 0 && fcsl_run_trace_rows(all) == TICKS + 1);
    free(expected);
    free(rows);
    CHECK(fcsl_run_close(run, &error) == 0); /* ends the other one */
}

static void test_what_is_no_trace(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_run(library);
    const uint32_t size = fcsl_run_machine(run)->size;
    CHECK(fcsl_run_trace_begin(run, &(fcsl_range_t){size, 1}, 1, 1, &error) == NULL);
    CHECK(fcsl_run_trace_begin(run, &(fcsl_range_t){4, UINT32_MAX}, 1, 1, &error) == NULL);
    CHECK(fcsl_run_trace_begin(run, NULL, 0, 1, &error) == NULL);
    CHECK(fcsl_run_trace_begin(run, &(fcsl_range_t){0, size}, 1, 0, &error) == NULL);
    CHECK(fcsl_run_trace_begin(run, &(fcsl_range_t){0, size}, 1, UINT64_MAX, &error) == NULL);
    CHECK(fcsl_run_close(run, &error) == 0);
}

/* Values of a field that are fed are what the same sets at the same ticks give. */
static void test_values_are_fed(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *one = open_run(library);
    fcsl_run_t *two = open_run(library);
    const uint32_t field = find_writable(fcsl_run_machine(one));
    double values[TICKS];
    fcsl_sample_t samples[TICKS];
    for (uint32_t i = 0; i < TICKS; i++) {
        values[i] = 0.25 * i;
        samples[i] = (fcsl_sample_t){
            .tick = i, .channel = FCSL_NO_CHANNEL, .payload = 8u * i, .field = field, .size = sizeof values[i]};
        CHECK(fcsl_run_set(one, field, 0, &values[i], sizeof values[i], &error) == 0);
        CHECK(fcsl_run_step(one, 1, &error) == 0);
    }
    CHECK(fcsl_run_feed(two, samples, TICKS, values, sizeof values, TICKS, &error) == 0);
    CHECK(memcmp(fcsl_run_data(one), fcsl_run_data(two), fcsl_run_machine(one)->size) == 0);
    samples[0] = (fcsl_sample_t){
        .tick = TICKS, .channel = FCSL_NO_CHANNEL, .payload = sizeof values - 7u, .field = field, .size = 8};
    CHECK(fcsl_run_feed(two, samples, 1, values, sizeof values, TICKS + 1, &error) != 0);
    CHECK(strstr(error.text, "outside the buffer") != NULL);
    samples[0].payload = 0;
    samples[0].field = UINT32_MAX;
    CHECK(fcsl_run_feed(two, samples, 1, values, sizeof values, TICKS + 1, &error) != 0);
    CHECK(strstr(error.text, "no field number") != NULL && fcsl_run_tick(two) == TICKS);
    CHECK(fcsl_run_close(one, &error) == 0);
    CHECK(fcsl_run_close(two, &error) == 0);
}

static void test_checking_writes_nothing(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_run(library);
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    const uint32_t field = find_writable(machine);
    const double value = 123.5;
    double held = 0.0;
    CHECK(fcsl_run_check_set(run, field, 0, &value, sizeof value, &error) == 0);
    memcpy(&held, (const uint8_t *)fcsl_run_data(run) + machine->fields[field].offset, sizeof held);
    CHECK(held != value);
    CHECK(fcsl_run_check_set(run, field, machine->fields[field].count, &value, sizeof value, &error) != 0);
    CHECK(fcsl_run_check_set(run, 0, 0, &value, sizeof value, &error) != 0); /* the machine's own */
    CHECK(fcsl_run_set(run, field, 0, &value, sizeof value, &error) == 0);
    memcpy(&held, (const uint8_t *)fcsl_run_data(run) + machine->fields[field].offset, sizeof held);
    CHECK(held == value);
    CHECK(fcsl_run_close(run, &error) == 0);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    test_rows(argv[1]);
    test_what_is_no_trace(argv[1]);
    test_values_are_fed(argv[1]);
    test_checking_writes_nothing(argv[1]);
    return 0;
}
