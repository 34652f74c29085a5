/* SPDX-License-Identifier: Apache-2.0
 *
 * The command `stats`: what the host, the machine and the server count.
 */
#include <inttypes.h>
#include <string.h>

#include "machine/event_text.h"
#include "machine/fault_place.h"
#include "run/lost_requests.h"
#include "protocol.h"
#include "value.h"

enum { EVENTS_SHOWN = 64 };

void fcsl_vars_number(fcsl_vars_out_t *out, const char *name, uint64_t value)
{
    fcsl_json_raw(out, "%s\"%s\":%" PRIu64, out->text[out->at - 1] == '{' ? "" : ",", name, value);
}

void fcsl_vars_begin(fcsl_vars_out_t *out, const char *name)
{
    fcsl_json_raw(out, "%s\"%s\":{", out->text[out->at - 1] == '{' ? "" : ",", name);
}

void fcsl_vars_end(fcsl_vars_out_t *out)
{
    fcsl_json_raw(out, "}");
}

void fcsl_vars_histogram(fcsl_vars_out_t *out, const char *name, const fcsl_histogram_t *histogram)
{
    fcsl_summary_t summary;
    fcsl_histogram_summary(histogram, &summary);
    fcsl_vars_begin(out, name);
    fcsl_vars_number(out, "count", summary.count);
    fcsl_vars_number(out, "p50", summary.p50);
    fcsl_vars_number(out, "p99", summary.p99);
    fcsl_vars_number(out, "p999", summary.p999);
    fcsl_vars_number(out, "max", summary.max);
    fcsl_json_raw(out, ",\"buckets\":[");
    const char *comma = "";
    for (uint32_t i = 0; i < FCSL_HISTOGRAM_BUCKETS; i++) {
        const uint64_t count = fcsl_tick_stats_get(&histogram->counts[i]);
        if (count > 0) {
            fcsl_json_raw(out, "%s[%" PRIu64 ",%" PRIu64 "]", comma, fcsl_histogram_end(i), count);
            comma = ",";
        }
    }
    fcsl_json_raw(out, "]");
    fcsl_vars_end(out);
}

void fcsl_vars_tick_stats(fcsl_vars_out_t *out, const fcsl_tick_stats_t *stats)
{
    fcsl_vars_number(out, "ticks", fcsl_tick_stats_get(&stats->ticks));
    fcsl_vars_number(out, "hardware_failures", fcsl_tick_stats_get(&stats->hardware_failures));
    fcsl_vars_number(out, "messages_refused", fcsl_tick_stats_get(&stats->messages_refused));
    fcsl_vars_number(out, "records_dropped", fcsl_tick_stats_get(&stats->records_dropped));
    fcsl_vars_histogram(out, "tick_time_ns", &stats->tick_time);
}

void fcsl_vars_lost_requests(fcsl_vars_out_t *out, const fcsl_machine_t *machine, const uint8_t *data)
{
    uint32_t next = 0;
    fcsl_lost_request_t lost;
    const char *comma = "";
    fcsl_vars_begin(out, "lost_requests");
    while (fcsl_lost_request_next(machine, data, &next, &lost)) {
        fcsl_json_raw(out, "%s", comma);
        fcsl_json_quoted(out, lost.name);
        fcsl_json_raw(out, ":%" PRIu64, lost.count);
        comma = ",";
    }
    fcsl_vars_end(out);
}

static const char *const KINDS[] = {"then", "never", "at_end"};
static const char *const STATUS[] = {"met", "violated", "not exercised"};

/* `behind` the values in the rows: those of the first tick, or of the last. */
static void put_kept(fcsl_vars_out_t *out, const fcsl_run_t *run, const uint8_t *rows, uint32_t index, uint32_t behind)
{
    uint32_t count = 0;
    const fcsl_field_t *kept = fcsl_run_kept_values(run, index, &count);
    for (uint32_t i = 0; i < count; i++) {
        const target_t target = {
            .field = &kept[i], .machine = fcsl_run_machine(run), .view = fcsl_view_whole(&kept[i])};
        fcsl_json_text(out, i > 0 ? "," : "");
        fcsl_json_quoted(out, kept[i].path);
        fcsl_json_text(out, ":");
        fcsl_value_write(&target, rows + kept[i].offset + behind, out);
    }
}

void fcsl_vars_requirements(fcsl_vars_out_t *out, const fcsl_run_t *run, const uint8_t *data)
{
    const fcsl_monitor_t *monitor = fcsl_run_monitor(run);
    fcsl_vars_begin(out, "requirements");
    for (uint32_t i = 0; monitor != NULL && i < monitor->requirement_count; i++) {
        fcsl_verdict_t verdict;
        char text[FCSL_VERDICT_TEXT_MAX];
        fcsl_run_verdict(run, data, i, &verdict);
        fcsl_run_verdict_text(run, &verdict, text);
        fcsl_vars_begin(out, verdict.requirement->id);
        fcsl_json_raw(out, "\"status\":\"%s\",\"kind\":\"%s\",\"text\":", STATUS[verdict.status],
                      KINDS[verdict.requirement->kind]);
        fcsl_json_quoted(out, verdict.requirement->text);
        fcsl_json_raw(out, ",\"source\":");
        fcsl_json_quoted(out, verdict.requirement->source);
        fcsl_json_raw(out, ",\"line\":");
        fcsl_json_quoted(out, text);
        fcsl_json_raw(out, ",\"assumed\":%s,\"holds\":%s", verdict.requirement->assumed ? "true" : "false",
                      verdict.holds ? "true" : "false");
        fcsl_vars_number(out, "evaluated", verdict.evaluated);
        fcsl_vars_number(out, "exercised", verdict.exercised);
        fcsl_vars_number(out, "undefined", verdict.undefined);
        fcsl_vars_number(out, "faults", verdict.faults);
        fcsl_vars_number(out, "violations", verdict.violations);
        fcsl_vars_number(out, "violated_ticks", verdict.violated_ticks);
        if (verdict.forgot_before > 0) {
            fcsl_vars_number(out, "forgot_before", verdict.forgot_before);
        }
        if (verdict.violations > 0) {
            fcsl_vars_number(out, "first_tick", verdict.first_tick);
            fcsl_vars_number(out, "last_tick", verdict.last_tick);
            fcsl_vars_begin(out, "first");
            put_kept(out, run, data, i, 0);
            fcsl_vars_end(out);
            fcsl_vars_begin(out, "last");
            put_kept(out, run, data, i, FCSL_KEPT_LAST);
            fcsl_vars_end(out);
        }
        fcsl_vars_end(out);
    }
    fcsl_vars_end(out);
}

/* As numbers, true and false; the others as texts. */
static void put_values(fcsl_vars_out_t *out, const fcsl_event_site_t *site, const uint64_t *values)
{
    fcsl_json_raw(out, ",\"values\":[");
    for (uint32_t i = 0; i < site->value_count; i++) {
        char text[SCALAR_TEXT_BYTES];
        fcsl_event_value_text(site->types[i], values[i], text);
        const int is_word = site->types[i] == FCSL_HEALTH || strspn(text, "-infa") == strlen(text);
        fcsl_json_raw(out, i > 0 ? "," : "");
        fcsl_json_raw(out, is_word ? "\"%s\"" : "%s", text);
    }
    fcsl_json_raw(out, "]");
}

static void put_event(fcsl_vars_out_t *out, const fcsl_machine_t *machine, const fcsl_told_event_t *event)
{
    const fcsl_event_site_t *site = &machine->event_sites[event->site];
    char text[FCSL_EVENT_TEXT_MAX];
    fcsl_event_text(machine, event, text);
    fcsl_json_raw(out, "{\"tick\":%" PRIu64 ",\"severity\":\"%s\",\"instance\":", event->tick,
                  fcsl_severity_name(site->severity));
    fcsl_json_quoted(out, machine->instances[site->instance].name);
    fcsl_json_raw(out, ",\"message\":");
    fcsl_json_quoted(out, text);
    fcsl_json_raw(out, ",\"text\":");
    fcsl_json_quoted(out, site->text);
    put_values(out, site, event->values);
    fcsl_vars_number(out, "suppressed", event->suppressed);
    fcsl_json_raw(out, ",\"file\":");
    fcsl_json_quoted(out, site->file);
    fcsl_json_raw(out, ",\"line\":%" PRIu32 "}", site->line);
}

void fcsl_vars_events(fcsl_vars_out_t *out, const fcsl_run_t *run)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    const fcsl_event_counts_t events = fcsl_run_event_counts(run);
    fcsl_vars_begin(out, "events");
    fcsl_vars_number(out, "told", events.told);
    fcsl_vars_number(out, "suppressed", events.suppressed);
    fcsl_vars_number(out, "lost", events.lost);
    fcsl_json_raw(out, ",\"last\":[");
    fcsl_told_event_t event;
    const char *comma = "";
    uint64_t next = events.told > EVENTS_SHOWN ? events.told - EVENTS_SHOWN : 0;
    while (next < events.told && (next = fcsl_run_next_event(run, next, &event)) != 0) {
        fcsl_json_raw(out, "%s", comma);
        put_event(out, machine, &event);
        comma = ",";
    }
    fcsl_json_raw(out, "]");
    fcsl_vars_end(out);
}

void fcsl_vars_times(fcsl_vars_out_t *out, const fcsl_run_t *run)
{
    fcsl_run_time_t time;
    if (fcsl_run_time(run, 0, &time) != 0) {
        return;
    }
    fcsl_vars_begin(out, "times");
    for (uint32_t i = 0; fcsl_run_time(run, i, &time) == 0; i++) { /* ends behind the last row */
        fcsl_vars_begin(out, time.name);
        fcsl_vars_number(out, "runs", time.runs);
        fcsl_vars_number(out, "total_ns", time.total_ns);
        fcsl_vars_number(out, "mean_ns", time.mean_ns);
        fcsl_vars_number(out, "p50_ns", time.p50_ns);
        fcsl_vars_number(out, "p99_ns", time.p99_ns);
        fcsl_vars_number(out, "max_ns", time.max_ns);
        fcsl_vars_end(out);
    }
    fcsl_vars_end(out);
}

/* The block that serves the verdicts of the host's run; block_count without. */
static uint32_t verdict_block(const protocol_t *protocol)
{
    const catalog_t *catalog = &protocol->catalog;
    uint32_t unused = 0;
    const fcsl_field_t *fields =
        protocol->host->run != NULL ? fcsl_run_verdict_fields(protocol->host->run, &unused) : NULL;
    uint32_t block = 0;
    while (block < catalog->block_count && (fields == NULL || catalog->blocks[block].fields != fields)) {
        block++;
    }
    return block;
}

/* Where the instances that have faulted did so last, by their names. */
static void put_fault_places(json_out_t *out, const fcsl_machine_t *machine, const uint8_t *data)
{
    const char *comma = "";
    fcsl_vars_begin(out, "fault_places");
    for (uint32_t i = 0; i < machine->instance_count; i++) {
        char text[FCSL_FAULT_TEXT_MAX];
        if (fcsl_fault_text(machine, data, i, text)[0] != '\0') {
            fcsl_json_raw(out, "%s", comma);
            fcsl_json_quoted(out, machine->instances[i].name);
            fcsl_json_raw(out, ":");
            fcsl_json_quoted(out, text);
            comma = ",";
        }
    }
    fcsl_vars_end(out);
}

int fcsl_handle_stats(request_t *request)
{
    const protocol_t *protocol = request->protocol;
    const catalog_t *catalog = &protocol->catalog;
    const service_counters_t *service = protocol->counters;
    json_out_t *out = request->out;
    if (fcsl_request_snapshot(request) != 0) {
        return -1;
    }
    fcsl_request_status(protocol, out);
    if (protocol->host->stats != NULL) {
        protocol->host->stats(protocol->host->ctx, out);
    }
    if (catalog->machine < catalog->block_count) {
        uint64_t faults = 0;
        uint64_t overruns = 0;
        const fcsl_machine_t *machine = catalog->blocks[catalog->machine].machine;
        const uint8_t *data = protocol->snapshot + catalog->bases[catalog->machine];
        fcsl_tick_stats_faults(machine, data, &faults, &overruns);
        fcsl_vars_number(out, "faults", faults);
        fcsl_vars_number(out, "overruns", overruns);
        put_fault_places(out, machine, data);
        fcsl_vars_lost_requests(out, machine, data);
    }
    if (protocol->host->run != NULL && fcsl_run_machine(protocol->host->run)->event_site_count > 0) {
        fcsl_vars_events(out, protocol->host->run);
    }
    if (protocol->host->run != NULL) {
        fcsl_vars_times(out, protocol->host->run);
    }
    const uint32_t verdicts = verdict_block(protocol);
    if (verdicts < catalog->block_count) {
        fcsl_vars_requirements(out, protocol->host->run, protocol->snapshot + catalog->bases[verdicts]);
    }
    fcsl_vars_number(out, "requests", atomic_load(&service->requests));
    fcsl_vars_number(out, "requests_refused", atomic_load(&service->requests_refused));
    fcsl_vars_number(out, "clients_dropped", atomic_load(&service->clients_dropped));
    fcsl_vars_number(out, "samples_lost", atomic_load(&service->samples_lost));
    return 0;
}
