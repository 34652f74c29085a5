/* SPDX-License-Identifier: Apache-2.0
 *
 * Logs events.
 */
#include "event_log.h"

#include <inttypes.h>

#include "log.h"

static void print_event(const fcsl_machine_t *machine, const fcsl_told_event_t *event)
{
    const fcsl_event_site_t *site = &machine->event_sites[event->site];
    const char *instance = machine->instances[site->instance].name;
    char text[FCSL_EVENT_TEXT_MAX];
    fcsl_event_text(machine, event, text);
    if (site->severity >= FCSL_WARNING) {
        log_error("%s: '%s': %s (tick %" PRIu64 ", %s:%" PRIu32 ")", fcsl_severity_name(site->severity), instance, text,
                  event->tick, site->file, site->line);
    } else if (site->severity == FCSL_INFO) {
        log_info("'%s': %s (tick %" PRIu64 ")", instance, text, event->tick);
    }
}

void event_log_update(event_log_t *log, const fcsl_run_t *run)
{
    const fcsl_machine_t *machine = fcsl_run_machine(run);
    fcsl_told_event_t event;
    uint64_t missed = 0;
    for (uint32_t i = 0; i < FCSL_EVENTS_KEPT; i++) {
        const uint64_t next = fcsl_run_next_event(run, log->next, &event);
        if (next == 0) {
            break;
        }
        missed += next - 1u - log->next;
        log->next = next;
        print_event(machine, &event);
    }
    if (missed > 0) {
        log_error("%" PRIu64 " events were overwritten before they were logged", missed);
    }
}
