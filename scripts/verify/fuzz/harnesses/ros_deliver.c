/* SPDX-License-Identifier: Apache-2.0
 *
 * fcsl_sample_input.h: messages that come in while the fixture machine runs (a stamp and a gyro). Input: messages, each of the time
 * since the last one in 0.1 ms (2), how (1), length (1) and bytes. Of how, bit 0 stamps it with a time close to now, bit 1
 * makes its sequence one of three numbers, bit 2 marks it as missing, bit 3 steps the machine.
 */
#include "fcsl/fcsl_sample_input.h"
#include "fcsl/fcsl_scalar.h"
#include "fuzz.h"

enum { HEAD_BYTES = 16 };

extern const fcsl_machine_t *const fcsl_machines[];

static const fcsl_ros_part_t PARTS[] = {{FCSL_ROS_BLOCK, 8, 8, 0, 0}, {FCSL_ROS_SEQUENCE, 8, 8, 0, 1}};
static const fcsl_ros_pick_t PICKS[] = {{1, 3, 0, FCSL_ROS_NONE}};
static const fcsl_ros_term_t TERMS[] = {
    {1.0, 1, 0, FCSL_ROS_F64}, {1.0, 1, 8, FCSL_ROS_F64}, {1.0, 1, 16, FCSL_ROS_F64}};
static const fcsl_ros_row_t ROWS[] = {
    {0, 1, 0, FCSL_ROS_F64, 0, 0, 0, 0}, {1, 1, 8, FCSL_ROS_F64, 0, 0, 0, 0}, {2, 1, 16, FCSL_ROS_F64, 0, 0, 0, 0}};
static const fcsl_ros_value_t ROW_VALUES[] = {{0, 24, 0, 3, 0, 0, 0}};
static const fcsl_ros_reader_plan_t CONVERSION = {.parts = PARTS,
                                                  .picks = PICKS,
                                                  .values = ROW_VALUES,
                                                  .rows = ROWS,
                                                  .terms = TERMS,
                                                  .part_count = 2,
                                                  .pick_count = 1,
                                                  .value_count = 1,
                                                  .row_count = 3,
                                                  .term_count = 3,
                                                  .anchor_count = 2,
                                                  .size = 24};

static void deliver(fcsl_run_t *run, fcsl_sample_input_t *input, int64_t now_ns, bytes_t *bytes)
{
    fcsl_error_t error;
    const uint64_t how = take_number(bytes, 1);
    size_t size = (size_t)take_number(bytes, 1);
    uint8_t *message = take_copy(bytes, &size);
    if (size >= HEAD_BYTES && (how & 1u) != 0) {
        const uint64_t stamp_ns = (uint64_t)now_ns + (uint64_t)message[4] * 1000000u - 100000000u;
        fcsl_put_u32(message, 0x100); /* little-endian CDR */
        fcsl_put_u32(message + 4, (uint32_t)(stamp_ns / 1000000000u));
        fcsl_put_u32(message + 8, (uint32_t)(stamp_ns % 1000000000u));
    }
    if (size >= HEAD_BYTES && (how & 2u) != 0) {
        fcsl_put_u32(message + 12, 3);
    }
    const uint8_t missing[] = {(how & 4u) != 0};
    FUZZ_CHECK(fcsl_sample_input_deliver(input, message, size, now_ns, missing) <= 1u - missing[0]);
    FUZZ_CHECK((how & 8u) == 0 || fcsl_run_step(run, 1, &error) == 0);
    free(message);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size)
{
    static const uint32_t channels[] = {0};
    bytes_t bytes = {data, size};
    fcsl_error_t error;
    fcsl_run_t *run = fcsl_run_open_machine(fcsl_machines[0], NULL, &error);
    fcsl_ros_reader_t *reader = fcsl_ros_reader_new(&CONVERSION, &error);
    FUZZ_CHECK(run != NULL && reader != NULL && fcsl_run_attach(run, &error) == 0);
    fcsl_sample_input_t *input = fcsl_sample_input_new(run, reader, channels, 1, &error);
    FUZZ_CHECK(input != NULL);
    int64_t now_ns = 1000000000;
    while (bytes.left > 0) {
        now_ns += (int64_t)take_number(&bytes, 2) * 100000;
        deliver(run, input, now_ns, &bytes);
    }
    fcsl_sample_input_free(input);
    fcsl_ros_reader_free(reader);
    FUZZ_CHECK(fcsl_run_close(run, &error) == 0);
    return 0;
}
