/* SPDX-License-Identifier: Apache-2.0
 *
 * Many samples at once, and the records of an MCAP chunk. Argument: the fixture library.
 */
#include <string.h>

#include "fcsl/fcsl_mcap_records.h"
#include "fcsl/fcsl_run.h"
#include "fcsl_check.h"

enum { GYRO = 0, ARMED = 1, TICKS = 40, RECORDS = 8 };

static fcsl_run_t *open_attached(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open(library, NULL, NULL, &error);
    CHECK(run != NULL);
    CHECK(fcsl_run_attach(run, &error) == 0);
    return run;
}

static size_t machine_size(const fcsl_run_t *run)
{
    return fcsl_run_machine(run)->size;
}

/* The same as writing and stepping one by one, whatever the slices. */
static void test_feeding_is_writing_and_stepping(const char *library)
{
    const double gyro[6] = {1.5, -2.5, 0.0, 7.0, 8.0, 9.0}; /* three each, from any of the first four on */
    uint8_t payloads[sizeof gyro + 1];
    memcpy(payloads, gyro, sizeof gyro);
    payloads[sizeof gyro] = 1;
    const uint32_t gyro_bytes = 24u;
    const fcsl_sample_t samples[] = {
        {.tick = 0, .stamp_ns = 11, .channel = GYRO, .payload = 0},
        {.tick = 0, .stamp_ns = 12, .channel = ARMED, .payload = sizeof gyro},
        {.tick = 7, .stamp_ns = 13, .channel = GYRO, .age_ticks = 3, .payload = 8},
        {.tick = 7, .stamp_ns = 14, .channel = GYRO, .payload = 16}, /* the later one of a tick counts */
        {.tick = 39, .stamp_ns = -1, .channel = GYRO, .payload = 24},
    };
    const size_t count = sizeof samples / sizeof samples[0];
    fcsl_error_t error;
    fcsl_run_t *one = open_attached(library);
    fcsl_run_t *two = open_attached(library);
    fcsl_run_t *many = open_attached(library);
    for (size_t i = 0; i < count; i++) {
        CHECK(fcsl_run_step(one, samples[i].tick - fcsl_run_tick(one), &error) == 0);
        CHECK(fcsl_run_write_channel(one, samples[i].channel, payloads + samples[i].payload,
                                     samples[i].channel == GYRO ? gyro_bytes : 1u, samples[i].age_ticks,
                                     samples[i].stamp_ns, &error) == 0);
    }
    CHECK(fcsl_run_step(one, TICKS - fcsl_run_tick(one), &error) == 0);
    CHECK(fcsl_run_feed(two, samples, count, payloads, sizeof payloads, TICKS, &error) == 0);
    CHECK(fcsl_run_feed(many, samples, 2, payloads, sizeof payloads, 5, &error) == 0);
    CHECK(fcsl_run_feed(many, NULL, 0, payloads, sizeof payloads, 7, &error) == 0);
    CHECK(fcsl_run_feed(many, samples + 2, 3, payloads, sizeof payloads, TICKS, &error) == 0);
    CHECK(fcsl_run_tick(two) == TICKS && fcsl_run_tick(many) == TICKS);
    CHECK(memcmp(fcsl_run_data(one), fcsl_run_data(two), machine_size(one)) == 0);
    CHECK(memcmp(fcsl_run_data(one), fcsl_run_data(many), machine_size(one)) == 0);
    CHECK(fcsl_run_close(one, &error) == 0);
    CHECK(fcsl_run_close(two, &error) == 0);
    CHECK(fcsl_run_close(many, &error) == 0);
}

static const int64_t GYRO_TICKS[] = {0, 7, 7, 39};
static const int64_t GYRO_AGES[] = {0, 3, 0, 0};
static const int64_t GYRO_STAMPS[] = {11, 13, 14, -1};
static const int64_t GYRO_ROWS[] = {0, 2, 1, 2};
static const double GYRO_VALUES[3][4] = {{1.5, -2.5, 0.0, 99.0}, {7.0, 8.0, 9.0, 99.0}, {0.1, 0.2, 0.3, 99.0}};

static fcsl_series_t gyro_series(void)
{
    return (fcsl_series_t){.ticks = GYRO_TICKS,
                           .ages_ticks = GYRO_AGES,
                           .stamps_ns = GYRO_STAMPS,
                           .rows = GYRO_ROWS,
                           .values = (const uint8_t *)GYRO_VALUES,
                           .row_bytes = sizeof GYRO_VALUES[0],
                           .row_count = 3,
                           .count = 4,
                           .channel = GYRO};
}

/* Series are the same as one sample after another, whatever the slices. */
static void test_series_are_samples(const char *library)
{
    static const int64_t zero[] = {0};
    static const uint8_t armed[] = {1};
    const fcsl_series_t armed_series = {.ticks = zero,
                                        .ages_ticks = zero,
                                        .stamps_ns = zero,
                                        .rows = zero,
                                        .values = armed,
                                        .row_bytes = 1,
                                        .row_count = 1,
                                        .count = 1,
                                        .channel = ARMED};
    fcsl_error_t error;
    fcsl_run_t *one = open_attached(library);
    CHECK(fcsl_run_write_channel(one, ARMED, armed, 1, 0, 0, &error) == 0);
    for (int i = 0; i < 4; i++) {
        CHECK(fcsl_run_step(one, (uint64_t)GYRO_TICKS[i] - fcsl_run_tick(one), &error) == 0);
        CHECK(fcsl_run_write_channel(one, GYRO, GYRO_VALUES[GYRO_ROWS[i]], 24, (uint32_t)GYRO_AGES[i], GYRO_STAMPS[i],
                                     &error) == 0);
    }
    CHECK(fcsl_run_step(one, TICKS - fcsl_run_tick(one), &error) == 0);
    const uint64_t ends[][3] = {{TICKS, TICKS, TICKS}, {5, 7, TICKS}, {8, 39, TICKS}};
    for (size_t i = 0; i < sizeof ends / sizeof ends[0]; i++) {
        fcsl_run_t *fed = open_attached(library);
        fcsl_series_t series[] = {gyro_series(), armed_series};
        for (int j = 0; j < 3; j++) {
            CHECK(fcsl_run_feed_series(fed, series, 2, ends[i][j], &error) == 0);
            CHECK(fcsl_run_tick(fed) == ends[i][j]);
        }
        CHECK(series[0].next == 4 && series[1].next == 1);
        CHECK(memcmp(fcsl_run_data(one), fcsl_run_data(fed), machine_size(one)) == 0);
        CHECK(fcsl_run_close(fed, &error) == 0);
    }
    CHECK(fcsl_run_close(one, &error) == 0);
}

static void refuse_series(fcsl_run_t *run, fcsl_series_t series, const char *reason)
{
    fcsl_error_t error = {0};
    CHECK(fcsl_run_feed_series(run, &series, 1, TICKS, &error) != 0);
    CHECK(strstr(error.text, reason) != NULL);
}

static void test_series_that_cannot_be_fed(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_attached(library);
    fcsl_series_t series = gyro_series();
    series.channel = 99;
    refuse_series(run, series, "no channel number 99");
    series = gyro_series();
    series.row_count = 0;
    refuse_series(run, series, "a sample of 'imu.gyro' lies outside its values");
    series = gyro_series();
    series.row_bytes = 23;
    refuse_series(run, series, "lies outside its values");
    CHECK(fcsl_run_step(run, 1, &error) == 0);
    refuse_series(run, gyro_series(), "a sample of tick 0 is out of turn: tick 1 is due");
    CHECK(fcsl_run_tick(run) == 1);
    CHECK(fcsl_run_close(run, &error) == 0);
}

static void refuse(fcsl_run_t *run, fcsl_sample_t sample, size_t payload_bytes, uint64_t end, const char *reason)
{
    const uint8_t payloads[24] = {2}; /* no bool */
    fcsl_error_t error = {0};
    const uint64_t before = fcsl_run_tick(run);
    CHECK(fcsl_run_feed(run, &sample, 1, payloads, payload_bytes, end, &error) != 0);
    CHECK(strstr(error.text, reason) != NULL);
    CHECK(fcsl_run_tick(run) == before || sample.tick == fcsl_run_tick(run));
}

static void test_what_cannot_be_fed(const char *library)
{
    fcsl_error_t error;
    fcsl_run_t *run = open_attached(library);
    CHECK(fcsl_run_step(run, 5, &error) == 0);
    refuse(run, (fcsl_sample_t){.tick = 4}, 24, 10, "a sample of tick 4 is out of turn: tick 5 is due, 10 the end");
    refuse(run, (fcsl_sample_t){.tick = 10}, 24, 10, "out of turn");
    refuse(run, (fcsl_sample_t){.tick = 5, .channel = 99}, 24, 10, "no channel number 99");
    refuse(run, (fcsl_sample_t){.tick = 5, .payload = 1}, 24, 10, "lies outside the buffer");
    refuse(run, (fcsl_sample_t){.tick = 5, .payload = UINT64_MAX}, 24, 10, "lies outside the buffer");
    refuse(run, (fcsl_sample_t){.tick = 5}, 23, 10, "a sample of 'imu.gyro' lies outside");
    refuse(run, (fcsl_sample_t){.tick = 5, .channel = ARMED}, 24, 10, "cannot hold this value");
    CHECK(fcsl_run_feed(run, NULL, 0, NULL, 0, 3, &error) == 0); /* nothing to do: these ticks are done */
    CHECK(fcsl_run_tick(run) == 5);
    CHECK(fcsl_run_close(run, &error) == 0);
}

static size_t put_record(uint8_t *bytes, uint8_t opcode, const void *content, uint8_t size)
{
    memset(bytes, 0, 9);
    bytes[0] = opcode;
    bytes[1] = size;
    memcpy(bytes + 9, content, size);
    return 9u + size;
}

static void test_records_of_a_chunk(void)
{
    const uint8_t message[25] = {[0] = 0x02, [1] = 0x01, [6] = 0x10, [13] = 0x80, [22] = 'a', 'b', 'c'};
    uint8_t bytes[128];
    size_t size = put_record(bytes, 3, "schema", 6);
    size += put_record(bytes + size, 5, message, sizeof message);
    size += put_record(bytes + size, 5, message, 22); /* without data */
    fcsl_mcap_record_t records[RECORDS];
    CHECK(fcsl_mcap_records(bytes, size, 0, records, RECORDS) == 3);
    CHECK(records[0].opcode == 3 && records[0].begin == 9 && records[0].end == 15);
    CHECK(records[1].opcode == 5 && records[1].channel == 0x102 && records[1].log_ns == INT64_MIN + 16);
    CHECK(memcmp(bytes + records[1].begin, "abc", 3) == 0 && records[1].end == records[1].begin + 3);
    CHECK(records[2].begin == records[2].end && records[2].end == size);
    CHECK(fcsl_mcap_records(bytes, size, 0, records, 2) == 2);
    CHECK(fcsl_mcap_records(bytes, size, records[1].end, records, 2) == 1);
    CHECK(fcsl_mcap_records(bytes, size, size, records, 2) == 0);
    CHECK(fcsl_mcap_records(bytes, size, size + 1, records, 2) == 0);
    for (size_t cut = 0; cut < size; cut++) {
        const size_t whole = cut < 15 ? 0 : cut < 49 ? 1 : 2;
        CHECK(fcsl_mcap_records(bytes, cut, 0, records, RECORDS) == whole);
    }
    (void)put_record(bytes, 5, message, 21); /* too short for the head of a message */
    CHECK(fcsl_mcap_records(bytes, size, 0, records, RECORDS) == 0);
    memset(bytes, 0xff, sizeof bytes); /* lengths that overflow */
    CHECK(fcsl_mcap_records(bytes, sizeof bytes, 0, records, RECORDS) == 0);
}

int main(int argc, char **argv)
{
    CHECK(argc == 2);
    test_feeding_is_writing_and_stepping(argv[1]);
    test_what_cannot_be_fed(argv[1]);
    test_series_are_samples(argv[1]);
    test_series_that_cannot_be_fed(argv[1]);
    test_records_of_a_chunk();
    return 0;
}
