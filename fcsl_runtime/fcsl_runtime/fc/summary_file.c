/* SPDX-License-Identifier: Apache-2.0
 *
 * The file that a run leaves: state, health, counters and histograms as JSON.
 */
#define _GNU_SOURCE
#include "summary_file.h"

#include <inttypes.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_error.h"
#include "guard_link.h"
#include "machine/fault_place.h"
#include "machine/health_name.h"
#include "base/replace_file.h"
#include "vars/json.h"

/* A first guess of the text's size, and what no machine's text reaches. */
enum { TEXT_BYTES = 65536, TEXT_BYTES_MAX = 1 << 30 };

int last_state_check(const char *path, fcsl_error_t *error)
{
    fcsl_error_t why;
    const size_t length = strlen(path);
    if (length == 0 || path[length - 1u] == '/') {
        return fcsl_fail(error, "--summary: '%.200s' is no name of a file to write", path);
    }
    return fcsl_replace_file_check(path, &why) == 0 ? 0 : fcsl_fail(error, "--summary: %.480s", why.text);
}

static void put_text(json_out_t *out, const char *key, const char *text)
{
    fcsl_json_raw(out, "\"%s\":", key);
    fcsl_json_quoted(out, text);
    fcsl_json_raw(out, ",");
}

static void put_instances(json_out_t *out, const fcsl_machine_t *machine, const uint8_t *data)
{
    fcsl_json_raw(out, "\"instances\":{");
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        const fcsl_instance_t *instance = &machine->instances[i];
        int32_t health = 0;
        uint64_t faults = 0;
        uint64_t overruns = 0;
        memcpy(&health, data + instance->health_offset, sizeof health);
        memcpy(&faults, data + instance->faults_offset, sizeof faults);
        memcpy(&overruns, data + instance->overruns_offset, sizeof overruns);
        fcsl_json_raw(out, i > 0 ? ",\n" : "\n");
        fcsl_json_quoted(out, instance->name);
        char place[FCSL_FAULT_TEXT_MAX];
        fcsl_json_raw(out, ":{\"health\":\"%s\",\"faults\":%" PRIu64 ",\"overruns\":%" PRIu64 ",\"fault_place\":",
                      fcsl_health_name(health), faults, overruns);
        fcsl_json_quoted(out, fcsl_fault_text(machine, data, i, place));
        fcsl_json_raw(out, "}");
    }
    fcsl_json_raw(out, "},\n");
}

static void put_counters(json_out_t *out, const fcsl_machine_t *machine, const fcsl_tick_stats_t *stats,
                         const uint8_t *data)
{
    uint64_t faults = 0;
    uint64_t overruns = 0;
    fcsl_tick_stats_faults(machine, data, &faults, &overruns);
    fcsl_json_raw(out,
                  "\"counters\":{\"ticks\":%" PRIu64 ",\"deadlines_missed\":%" PRIu64 ",\"ticks_skipped\":%" PRIu64
                  ",\"watchdog_trips\":%" PRIu64,
                  fcsl_tick_stats_get(&stats->ticks), fcsl_tick_stats_get(&stats->deadlines_missed),
                  fcsl_tick_stats_get(&stats->ticks_skipped), fcsl_tick_stats_get(&stats->watchdog_trips));
    fcsl_json_raw(out,
                  ",\"faults\":%" PRIu64 ",\"overruns\":%" PRIu64 ",\"hardware_failures\":%" PRIu64
                  ",\"messages_refused\":%" PRIu64 ",\"records_dropped\":%" PRIu64 "}",
                  faults, overruns, fcsl_tick_stats_get(&stats->hardware_failures),
                  fcsl_tick_stats_get(&stats->messages_refused), fcsl_tick_stats_get(&stats->records_dropped));
}

static void put_hal(json_out_t *out, const loop_t *loop, const uint8_t *data)
{
    fcsl_json_raw(out, "\"hal\":{");
    for (uint32_t i = 0; i < loop->hal.field_count; i++) {
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, loop->hal.fields[i].path);
        fcsl_json_raw(out, ":%" PRIu64, loop_hal_count(loop, data, i));
    }
    fcsl_json_raw(out, "},\n");
}

static const char *state_name(const fcsl_machine_t *machine, const uint8_t *data, uint32_t offset)
{
    int32_t state = FCSL_NONE;
    memcpy(&state, data + offset, sizeof state);
    return state >= 0 && (uint32_t)state < machine->state_count ? machine->states[state].name : "";
}

static void put_all(json_out_t *out, const loop_t *loop, const uint8_t *data, const fcsl_moment_t *moment,
                    const char *ended)
{
    const fcsl_machine_t *machine = fcsl_run_machine(loop->run);
    fcsl_json_raw(out, "{");
    put_text(out, "machine", machine->name);
    put_text(out, "source_hash", machine->source_hash);
    put_text(out, "layout_hash", machine->layout_hash);
    put_text(out, "build_hash", machine->build_hash);
    put_text(out, "ended", ended);
    fcsl_json_raw(out, "\n\"tick\":%" PRIu64 ",", moment->tick);
    put_text(out, "state", state_name(machine, data, machine->state_offset));
    put_text(out, "next_state", state_name(machine, data, machine->next_state_offset));
    fcsl_json_raw(out, "\"paused\":%s,\n", moment->paused != 0 ? "true" : "false");
    put_instances(out, machine, data);
    put_hal(out, loop, data);
    put_text(out, "guard", guard_state_name(loop->guard_state));
    put_counters(out, machine, &loop->stats, data);
    fcsl_vars_events(out, loop->run);
    fcsl_vars_lost_requests(out, machine, data);
    fcsl_vars_requirements(out, loop->run, loop_verdicts(loop, data));
    fcsl_vars_times(out, loop->run);
    fcsl_vars_histogram(out, "lateness_ns", &loop->stats.lateness);
    fcsl_vars_histogram(out, "tick_time_ns", &loop->stats.tick_time);
    fcsl_json_raw(out, "}\n");
}

int last_state_write(const char *path, const loop_t *loop, const fcsl_moment_t *moment, const uint8_t *data,
                     const char *ended, fcsl_error_t *error)
{
    for (size_t capacity = TEXT_BYTES; capacity <= TEXT_BYTES_MAX; capacity *= 2) {
        json_out_t out;
        char *text = malloc(capacity);
        if (text == NULL) {
            break;
        }
        fcsl_json_begin(&out, text, capacity);
        put_all(&out, loop, data, moment, ended);
        const int status = out.overflow ? 1 : fcsl_replace_file(path, text, out.at, error);
        free(text);
        if (status <= 0) {
            return status;
        }
    }
    return fcsl_fail(error, "out of memory for '%.200s'", path);
}
