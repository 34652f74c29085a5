/* SPDX-License-Identifier: Apache-2.0
 *
 * Inlets: messages that come in while a machine runs become samples of its channels, with their own time and age.
 */
#include <inttypes.h>
#include <stdlib.h>

#include "fcsl/fcsl_error.h"
#include "fcsl/fcsl_ros_inlet.h"
#include "fcsl/fcsl_tick_time.h"

struct fcsl_ros_inlet {
    fcsl_run_t *run;
    fcsl_ros_reader_t *reader;
    const fcsl_ros_reader_plan_t *plan;
    uint32_t *channels; /* by value; behind the struct, then the status of each, then a row */
    uint8_t *status;
    uint8_t *row;
    int64_t last_ns; /* stamp of the last message taken, 0: none was */
    int64_t behind_ns;
    uint64_t counts[FCSL_ROS_STATUSES];
};

static int channels_fit(const fcsl_machine_t *machine, const fcsl_ros_reader_plan_t *plan, const uint32_t *channels,
                        uint32_t count, fcsl_error_t *error)
{
    if (count != plan->value_count) {
        return fcsl_fail(error, "a message of %" PRIu32 " values for %" PRIu32 " channels", plan->value_count, count);
    }
    for (uint32_t i = 0; i < count; i++) {
        if (channels[i] >= machine->channel_count || machine->channels[channels[i]].direction != FCSL_SENSOR) {
            return fcsl_fail(error, "no sensor channel number %" PRIu32, channels[i]);
        }
        const fcsl_channel_t *channel = &machine->channels[channels[i]];
        const uint32_t size = machine->fields[channel->field].size;
        if (size != plan->values[i].size) {
            return fcsl_fail(error, "channel '%s' has %" PRIu32 " bytes, its value in the message %" PRIu32,
                             channel->name, size, plan->values[i].size);
        }
    }
    return 0;
}

fcsl_ros_inlet_t *fcsl_ros_inlet_new(fcsl_run_t *run, fcsl_ros_reader_t *reader, const uint32_t *channels,
                                     uint32_t channel_count, fcsl_error_t *error)
{
    const fcsl_ros_reader_plan_t *plan = fcsl_ros_reader_plan(reader);
    if (channels_fit(fcsl_run_machine(run), plan, channels, channel_count, error) != 0) {
        return NULL;
    }
    const size_t numbers = channel_count * sizeof *channels;
    fcsl_ros_inlet_t *inlet = calloc(1, sizeof *inlet + numbers + channel_count + plan->size);
    if (inlet == NULL) {
        (void)fcsl_fail(error, "out of memory for the channels of a message");
        return NULL;
    }
    inlet->run = run;
    inlet->reader = reader;
    inlet->plan = plan;
    inlet->channels = (uint32_t *)(inlet + 1);
    inlet->status = (uint8_t *)inlet->channels + numbers;
    inlet->row = inlet->status + channel_count;
    for (uint32_t i = 0; i < channel_count; i++) {
        inlet->channels[i] = channels[i];
    }
    return inlet;
}

void fcsl_ros_inlet_free(fcsl_ros_inlet_t *inlet)
{
    free(inlet);
}

const uint64_t *fcsl_ros_inlet_counts(const fcsl_ros_inlet_t *inlet)
{
    return inlet->counts;
}

int64_t fcsl_ros_inlet_behind_ns(const fcsl_ros_inlet_t *inlet)
{
    return inlet->behind_ns;
}

/* Whether a message of this stamp comes in its turn. */
static fcsl_ros_status_t check_time(fcsl_ros_inlet_t *inlet, int64_t stamp_ns, int64_t now_ns)
{
    if (stamp_ns == 0) {
        return FCSL_ROS_TAKEN;
    }
    if (stamp_ns - FCSL_ROS_AHEAD_NS > now_ns) {
        return FCSL_ROS_FUTURE;
    }
    if (inlet->last_ns - FCSL_ROS_AHEAD_NS >
        now_ns) { /* the clock was set back: what was taken says nothing any more */
        inlet->last_ns = 0;
    }
    if (inlet->last_ns == 0 || stamp_ns > inlet->last_ns) {
        return FCSL_ROS_TAKEN;
    }
    return stamp_ns == inlet->last_ns ? FCSL_ROS_REPEATED : FCSL_ROS_OLDER;
}

/* Writes the values that were read and are not missing; returns how many, and counts those that were refused. */
static uint32_t write_channels(fcsl_ros_inlet_t *inlet, uint32_t age_ticks, int64_t stamp_ns, const uint8_t *missing)
{
    uint32_t written = 0;
    for (uint32_t i = 0; i < inlet->plan->value_count; i++) {
        if (missing != NULL && missing[i] != 0) {
            continue;
        }
        const fcsl_ros_value_t *value = &inlet->plan->values[i];
        uint8_t status = inlet->status[i];
        if (status == FCSL_ROS_TAKEN &&
            fcsl_run_write_channel(inlet->run, inlet->channels[i], inlet->row + value->offset, value->size, age_ticks,
                                   stamp_ns, NULL) != 0) {
            status = FCSL_ROS_RANGE; /* no such enumerator */
        }
        if (status == FCSL_ROS_TAKEN) {
            written++;
        } else {
            inlet->counts[status]++;
        }
    }
    return written;
}

uint32_t fcsl_ros_deliver(fcsl_ros_inlet_t *inlet, const uint8_t *cdr, size_t size, int64_t now_ns,
                          const uint8_t *missing)
{
    int64_t stamp_ns = 0;
    fcsl_ros_status_t status = fcsl_ros_read(inlet->reader, cdr, size, inlet->row, inlet->status, &stamp_ns);
    if (status == FCSL_ROS_TAKEN) {
        inlet->behind_ns = stamp_ns == 0 ? 0 : now_ns - stamp_ns;
        status = check_time(inlet, stamp_ns, now_ns);
    }
    if (status != FCSL_ROS_TAKEN) {
        inlet->counts[status]++;
        return 0;
    }
    const int64_t age_ns = stamp_ns == 0 || stamp_ns > now_ns ? 0 : now_ns - stamp_ns;
    const uint32_t age_ticks = fcsl_ticks_of(fcsl_run_machine(inlet->run)->tick_hz, (uint64_t)age_ns);
    const uint32_t written = write_channels(inlet, age_ticks, stamp_ns, missing);
    if (written > 0) {
        inlet->counts[FCSL_ROS_TAKEN]++;
        inlet->last_ns = stamp_ns != 0 ? stamp_ns : inlet->last_ns;
    }
    return written;
}
