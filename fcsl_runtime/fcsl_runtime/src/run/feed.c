/* SPDX-License-Identifier: Apache-2.0
 *
 * Many samples and values of fields at once, each at its tick.
 */
#include <inttypes.h>

#include "run_internal.h"

static int deliver(fcsl_run_t *run, const fcsl_sample_t *sample, const uint8_t *payloads, uint64_t payload_bytes,
                   fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    if (sample->channel == FCSL_NO_CHANNEL) {
        if (sample->payload > payload_bytes || sample->size > payload_bytes - sample->payload) {
            return fcsl_fail(error, "the payload of field number %" PRIu32 " lies outside the buffer", sample->field);
        }
        return fcsl_run_set(run, sample->field, sample->element, payloads + sample->payload, sample->size, error);
    }
    if (sample->channel >= machine->channel_count) {
        return fcsl_fail(error, "no channel number %" PRIu32, sample->channel);
    }
    const uint32_t size = machine->fields[machine->channels[sample->channel].field].size;
    if (sample->payload > payload_bytes || size > payload_bytes - sample->payload) {
        return fcsl_fail(error, "the payload of a sample of '%s' lies outside the buffer",
                         machine->channels[sample->channel].name);
    }
    return fcsl_run_write_channel(run, sample->channel, payloads + sample->payload, size, sample->age_ticks,
                                  sample->stamp_ns, error);
}

int fcsl_run_feed(fcsl_run_t *run, const fcsl_sample_t *samples, size_t count, const void *payloads,
                  uint64_t payload_bytes, uint64_t end, fcsl_error_t *error)
{
    for (size_t i = 0; i < count; i++) {
        const uint64_t tick = fcsl_run_tick(run);
        if (samples[i].tick < tick || samples[i].tick >= end) {
            return fcsl_fail(
                error, "a sample of tick %" PRIu64 " is out of turn: tick %" PRIu64 " is due, %" PRIu64 " the end",
                samples[i].tick, tick, end);
        }
        if (samples[i].tick > tick && fcsl_run_step(run, samples[i].tick - tick, error) != 0) {
            return -1;
        }
        if (deliver(run, &samples[i], payloads, payload_bytes, error) != 0) {
            return -1;
        }
    }
    const uint64_t tick = fcsl_run_tick(run);
    return tick < end ? fcsl_run_step(run, end - tick, error) : 0;
}

/* Delivers what a series has for the coming tick. */
static int deliver_due(fcsl_run_t *run, fcsl_series_t *series, uint64_t tick, fcsl_error_t *error)
{
    const fcsl_machine_t *machine = run->machine;
    const uint32_t size = machine->fields[machine->channels[series->channel].field].size;
    for (; series->next < series->count && (uint64_t)series->ticks[series->next] == tick; series->next++) {
        const uint64_t i = series->next;
        const uint64_t row = (uint64_t)series->rows[i];
        if (row >= series->row_count || size > series->row_bytes) {
            return fcsl_fail(error, "a sample of '%s' lies outside its values",
                             machine->channels[series->channel].name);
        }
        if (fcsl_run_write_channel(run, series->channel, series->values + row * series->row_bytes, size,
                                   (uint32_t)series->ages_ticks[i], series->stamps_ns[i], error) != 0) {
            return -1;
        }
    }
    return 0;
}

/* The tick of the next sample of a series that was not delivered; `end` where there is none before it. */
static uint64_t next_tick(const fcsl_series_t *series, uint64_t end)
{
    const uint64_t tick = series->next < series->count ? (uint64_t)series->ticks[series->next] : end;
    return tick < end ? tick : end;
}

int fcsl_run_feed_series(fcsl_run_t *run, fcsl_series_t *series, uint32_t count, uint64_t end, fcsl_error_t *error)
{
    for (uint32_t i = 0; i < count; i++) {
        if (series[i].channel >= run->machine->channel_count) {
            return fcsl_fail(error, "no channel number %" PRIu32, series[i].channel);
        }
    }
    /* Every turn makes a tick or more. */
    for (uint64_t tick = fcsl_run_tick(run); tick < end; tick = fcsl_run_tick(run)) {
        uint64_t due = end;
        for (uint32_t i = 0; i < count; i++) {
            if (deliver_due(run, &series[i], tick, error) != 0) {
                return -1;
            }
            const uint64_t next = next_tick(&series[i], end);
            if (next < tick) {
                return fcsl_fail(error, "a sample of tick %" PRIu64 " is out of turn: tick %" PRIu64 " is due", next,
                                 tick);
            }
            due = next < due ? next : due;
        }
        if (fcsl_run_step(run, due - tick, error) != 0) {
            return -1;
        }
    }
    return 0;
}
