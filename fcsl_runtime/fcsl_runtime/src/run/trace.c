/* SPDX-License-Identifier: Apache-2.0
 *
 * Traces: what ticks leave in parts of the machine struct, one row a tick, in memory of a fixed size.
 */
#include "trace.h"

#include <inttypes.h>
#include <stdlib.h>

struct fcsl_trace {
    fcsl_trace_t *next;
    uint8_t *rows;
    uint64_t capacity; /* rows */
    uint64_t taken;    /* rows, those written over included */
    uint64_t slot;     /* of the coming row */
    uint64_t row_bytes;
    uint32_t count;
    fcsl_range_t ranges[];
};

fcsl_trace_t *fcsl_run_trace_begin(fcsl_run_t *run, const fcsl_range_t *ranges, uint32_t count, uint64_t capacity,
                                   fcsl_error_t *error)
{
    uint64_t row_bytes = 0;
    for (uint32_t i = 0; i < count; i++) {
        if (ranges[i].offset > run->machine->size || ranges[i].size > run->machine->size - ranges[i].offset) {
            (void)fcsl_fail(error, "range %" PRIu32 " of a trace lies outside machine '%s'", i, run->machine->name);
            return NULL;
        }
        row_bytes += ranges[i].size;
    }
    const size_t head = sizeof(fcsl_trace_t) + count * sizeof *ranges;
    if (row_bytes == 0 || capacity == 0 || capacity > (SIZE_MAX - head) / row_bytes) {
        (void)fcsl_fail(error, "a trace of %" PRIu64 " rows of %" PRIu64 " bytes is none", capacity, row_bytes);
        return NULL;
    }
    fcsl_trace_t *trace = malloc(head + capacity * row_bytes);
    if (trace == NULL) {
        (void)fcsl_fail(error, "out of memory for a trace of %" PRIu64 " rows of %" PRIu64 " bytes", capacity,
                        row_bytes);
        return NULL;
    }
    *trace = (fcsl_trace_t){.next = run->traces,
                            .rows = (uint8_t *)(trace->ranges + count),
                            .capacity = capacity,
                            .row_bytes = row_bytes,
                            .count = count};
    memcpy(trace->ranges, ranges, count * sizeof *ranges);
    run->traces = trace;
    return trace;
}

void fcsl_trace_take(const fcsl_run_t *run)
{
    for (fcsl_trace_t *trace = run->traces; trace != NULL; trace = trace->next) {
        uint8_t *at = trace->rows + trace->slot * trace->row_bytes;
        for (uint32_t i = 0; i < trace->count; i++) {
            memcpy(at, run->data + trace->ranges[i].offset, trace->ranges[i].size);
            at += trace->ranges[i].size;
        }
        trace->slot = trace->slot + 1u < trace->capacity ? trace->slot + 1u : 0u;
        trace->taken++;
    }
}

uint64_t fcsl_run_trace_rows(const fcsl_trace_t *trace)
{
    return trace->taken;
}

int fcsl_run_trace_read(const fcsl_trace_t *trace, uint64_t first, uint64_t count, void *rows, fcsl_error_t *error)
{
    const uint64_t kept = trace->taken < trace->capacity ? 0 : trace->taken - trace->capacity;
    if (first < kept || first > trace->taken || count > trace->taken - first) {
        return fcsl_fail(error, "the trace has rows %" PRIu64 " to before %" PRIu64 ", not %" PRIu64 " from %" PRIu64,
                         kept, trace->taken, count, first);
    }
    const uint64_t begin = first % trace->capacity;
    const uint64_t head = count < trace->capacity - begin ? count : trace->capacity - begin;
    memcpy(rows, trace->rows + begin * trace->row_bytes, head * trace->row_bytes);
    memcpy((uint8_t *)rows + head * trace->row_bytes, trace->rows, (count - head) * trace->row_bytes);
    return 0;
}

void fcsl_run_trace_end(fcsl_run_t *run, fcsl_trace_t *trace)
{
    for (fcsl_trace_t **at = &run->traces; *at != NULL; at = &(*at)->next) {
        if (*at == trace) {
            *at = trace->next;
            free(trace);
            return;
        }
    }
}

void fcsl_trace_free(fcsl_run_t *run)
{
    while (run->traces != NULL) {
        fcsl_run_trace_end(run, run->traces);
    }
}
