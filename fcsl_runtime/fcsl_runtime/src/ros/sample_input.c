/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages that come in while a machine runs become samples of its channels, with their own time and age.
 */
#include <inttypes.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_sample_input.h"
#include "fcsl/fcsl_tick_time.h"

struct fcsl_sample_input {
    fcsl_run_t *run;
    fcsl_ros_reader_t *reader;
    const fcsl_ros_reader_plan_t *conversion;
    uint32_t *channels; /* by value; behind the struct, then the status of each, then a row */
    uint8_t *status;
    uint8_t *row;
    int64_t last_ns; /* stamp of the last message taken, 0: none was */
    int64_t behind_ns;
    uint64_t counts[FCSL_ROS_STATUSES];
};

static int channels_fit(const fcsl_machine_t *machine, const fcsl_ros_reader_plan_t *conversion,
                        const uint32_t *channels, uint32_t count, fcsl_error_t *error)
{
    if (count != conversion->value_count) {
        return fcsl_fail(error, "a message of %" PRIu32 " values for %" PRIu32 " channels", conversion->value_count,
                         count);
    }
    for (uint32_t i = 0; i < count; i++) {
        if (channels[i] >= machine->channel_count || machine->channels[channels[i]].direction != FCSL_SENSOR) {
            return fcsl_fail(error, "no sensor channel number %" PRIu32, channels[i]);
        }
        const fcsl_channel_t *channel = &machine->channels[channels[i]];
        const uint32_t size = machine->fields[channel->field].size;
        if (size != conversion->values[i].size) {
            return fcsl_fail(error, "channel '%s' has %" PRIu32 " bytes, its value in the message %" PRIu32,
                             channel->name, size, conversion->values[i].size);
        }
    }
    return 0;
}

fcsl_sample_input_t *fcsl_sample_input_new(fcsl_run_t *run, fcsl_ros_reader_t *reader, const uint32_t *channels,
                                           uint32_t channel_count, fcsl_error_t *error)
{
    const fcsl_ros_reader_plan_t *conversion = fcsl_ros_reader_conversion(reader);
    if (channels_fit(fcsl_run_machine(run), conversion, channels, channel_count, error) != 0) {
        return NULL;
    }
    const size_t numbers = channel_count * sizeof *channels;
    fcsl_sample_input_t *input = calloc(1, sizeof *input + numbers + channel_count + conversion->size);
    if (input == NULL) {
        (void)fcsl_fail(error, "out of memory for the channels of a message");
        return NULL;
    }
    input->run = run;
    input->reader = reader;
    input->conversion = conversion;
    input->channels = (uint32_t *)(input + 1);
    input->status = (uint8_t *)input->channels + numbers;
    input->row = input->status + channel_count;
    for (uint32_t i = 0; i < channel_count; i++) {
        input->channels[i] = channels[i];
    }
    return input;
}

void fcsl_sample_input_free(fcsl_sample_input_t *input)
{
    free(input);
}

const uint64_t *fcsl_sample_input_counts(const fcsl_sample_input_t *input)
{
    return input->counts;
}

int64_t fcsl_sample_input_behind_ns(const fcsl_sample_input_t *input)
{
    return input->behind_ns;
}

/* Whether a message of this stamp comes in its turn. */
static fcsl_ros_status_t check_time(fcsl_sample_input_t *input, int64_t stamp_ns, int64_t now_ns)
{
    if (stamp_ns == 0) {
        return FCSL_ROS_TAKEN;
    }
    if (stamp_ns - FCSL_ROS_AHEAD_NS > now_ns) {
        return FCSL_ROS_FUTURE;
    }
    if (input->last_ns - FCSL_ROS_AHEAD_NS >
        now_ns) { /* the clock was set back: what was taken says nothing any more */
        input->last_ns = 0;
    }
    if (input->last_ns == 0 || stamp_ns > input->last_ns) {
        return FCSL_ROS_TAKEN;
    }
    return stamp_ns == input->last_ns ? FCSL_ROS_REPEATED : FCSL_ROS_OLDER;
}

/* Writes the values that were read and are not missing; returns how many, and counts those that were refused. */
static uint32_t write_channels(fcsl_sample_input_t *input, uint32_t age_ticks, int64_t stamp_ns, const uint8_t *missing)
{
    uint32_t written = 0;
    for (uint32_t i = 0; i < input->conversion->value_count; i++) {
        if (missing != NULL && missing[i] != 0) {
            continue;
        }
        const fcsl_ros_value_t *value = &input->conversion->values[i];
        uint8_t status = input->status[i];
        if (status == FCSL_ROS_TAKEN &&
            fcsl_run_write_channel(input->run, input->channels[i], input->row + value->offset, value->size, age_ticks,
                                   stamp_ns, NULL) != 0) {
            status = FCSL_ROS_RANGE; /* no such enumerator */
        }
        if (status == FCSL_ROS_TAKEN) {
            written++;
        } else {
            input->counts[status]++;
        }
    }
    return written;
}

uint32_t fcsl_sample_input_deliver(fcsl_sample_input_t *input, const uint8_t *cdr, size_t size, int64_t now_ns,
                                   const uint8_t *missing)
{
    int64_t stamp_ns = 0;
    fcsl_ros_status_t status = fcsl_ros_read(input->reader, cdr, size, input->row, input->status, &stamp_ns);
    if (status == FCSL_ROS_TAKEN) {
        input->behind_ns = stamp_ns == 0 ? 0 : now_ns - stamp_ns;
        status = check_time(input, stamp_ns, now_ns);
    }
    if (status != FCSL_ROS_TAKEN) {
        input->counts[status]++;
        return 0;
    }
    const int64_t age_ns = stamp_ns == 0 || stamp_ns > now_ns ? 0 : now_ns - stamp_ns;
    const uint32_t age_ticks = fcsl_ticks_of(fcsl_run_machine(input->run)->tick_hz, (uint64_t)age_ns);
    const uint32_t written = write_channels(input, age_ticks, stamp_ns, missing);
    if (written > 0) {
        input->counts[FCSL_ROS_TAKEN]++;
        input->last_ns = stamp_ns != 0 ? stamp_ns : input->last_ns;
    }
    return written;
}
