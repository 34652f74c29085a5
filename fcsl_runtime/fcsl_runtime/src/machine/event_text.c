/* SPDX-License-Identifier: Apache-2.0
 *
 * Events as text.
 */
#include "event_text.h"

#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <string.h>

#include "fcsl/fcsl_run.h"
#include "health_name.h"

static void float_text(double value, uint8_t type, char text[SCALAR_TEXT_BYTES])
{
    if (isnan(value)) {
        (void)snprintf(text, SCALAR_TEXT_BYTES, "nan");
        return;
    }
    fcsl_float_text(value, type, text);
}

void fcsl_event_value_text(uint8_t type, uint64_t bits, char text[SCALAR_TEXT_BYTES])
{
    double wide = 0.0;
    float narrow = 0.0f;
    const uint32_t low = (uint32_t)bits;
    switch (type) {
    case FCSL_F64:
        memcpy(&wide, &bits, sizeof wide);
        float_text(wide, FCSL_F64, text);
        break;
    case FCSL_F32:
        memcpy(&narrow, &low, sizeof narrow);
        float_text((double)narrow, FCSL_F32, text);
        break;
    case FCSL_BOOL:
        (void)snprintf(text, SCALAR_TEXT_BYTES, "%s", bits != 0 ? "true" : "false");
        break;
    case FCSL_HEALTH:
        (void)snprintf(text, SCALAR_TEXT_BYTES, "%s", fcsl_health_name((int32_t)low));
        break;
    case FCSL_U32:
    case FCSL_U64:
        (void)snprintf(text, SCALAR_TEXT_BYTES, "%" PRIu64, bits);
        break;
    default:
        (void)snprintf(text, SCALAR_TEXT_BYTES, "%" PRId64, (int64_t)bits);
        break;
    }
}

void fcsl_event_text(const fcsl_machine_t *machine, const fcsl_told_event_t *event, char text[FCSL_EVENT_TEXT_MAX])
{
    const fcsl_event_site_t *site = &machine->event_sites[event->site];
    size_t at = (size_t)snprintf(text, FCSL_EVENT_TEXT_MAX, "%.80s", site->text);
    for (uint32_t i = 0; i < site->value_count && at < FCSL_EVENT_TEXT_MAX; i++) {
        char value[SCALAR_TEXT_BYTES];
        fcsl_event_value_text(site->types[i], event->values[i], value);
        at += (size_t)snprintf(text + at, FCSL_EVENT_TEXT_MAX - at, " %.32s", value);
    }
    if (event->suppressed > 0 && at < FCSL_EVENT_TEXT_MAX) {
        (void)snprintf(text + at, FCSL_EVENT_TEXT_MAX - at, " (%" PRIu32 " before it suppressed)", event->suppressed);
    }
}

const char *fcsl_severity_name(uint8_t severity)
{
    static const char *const names[] = {"debug", "info", "warning", "error"};
    return names[severity <= FCSL_ERROR ? severity : FCSL_ERROR];
}
