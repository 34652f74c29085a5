/* SPDX-License-Identifier: Apache-2.0
 *
 * Writes events as CDR.
 */
#include "event_message.h"

#include <string.h>

#include "machine/event_text.h"

/* Header, numbers, the text of an event, and its values. */
enum { BASE_BYTES = 256 + FCSL_EVENT_VALUES * (SCALAR_TEXT_BYTES + 8) };

size_t fcsl_event_message_capacity(const fcsl_machine_t *machine)
{
    size_t most = 0;
    for (uint32_t i = 0; i < machine->event_site_count; i++) {
        const fcsl_event_site_t *site = &machine->event_sites[i];
        const size_t bytes = strlen(machine->instances[site->instance].name) + strlen(site->text) + strlen(site->file);
        most = bytes > most ? bytes : most;
    }
    return most + BASE_BYTES;
}

size_t fcsl_event_message(const fcsl_machine_t *machine, const fcsl_told_event_t *event, fcsl_stamp_t stamp,
                          uint8_t *bytes, size_t capacity)
{
    const fcsl_event_site_t *site = &machine->event_sites[event->site];
    fcsl_cdr_t cdr;
    fcsl_tick_message_begin(&cdr, stamp, bytes, capacity);
    fcsl_cdr_u8(&cdr, (uint8_t)(10u * (1u + site->severity))); /* as rcl_interfaces/Log has them */
    fcsl_cdr_string(&cdr, machine->instances[site->instance].name);
    fcsl_cdr_string(&cdr, site->text);
    fcsl_cdr_u32(&cdr, site->value_count);
    for (uint32_t i = 0; i < site->value_count; i++) {
        char text[SCALAR_TEXT_BYTES];
        fcsl_event_value_text(site->types[i], event->values[i], text);
        fcsl_cdr_string(&cdr, text);
    }
    fcsl_cdr_string(&cdr, site->file);
    fcsl_cdr_u32(&cdr, site->line);
    fcsl_cdr_u32(&cdr, event->suppressed);
    return fcsl_cdr_end(&cdr);
}
