/* SPDX-License-Identifier: Apache-2.0
 *
 * What the threads of Zenoh bring to a session. They never wait for the thread that steps.
 */
#define _GNU_SOURCE
#include "bus_session.h"

static void put(fcsl_bus_t *bus, uint32_t input, const uint8_t *bytes, size_t size)
{
    counters_t *counters = &bus->counters;
    bus_count(&counters->received, 1);
    if (bytes == NULL) {
        bus_count(&counters->deletions, 1);
        return;
    }
    (void)pthread_mutex_lock(&bus->putting);
    const inbox_result_t result = inbox_put(&bus->inboxes[input], bytes, size);
    (void)pthread_mutex_unlock(&bus->putting);
    switch (result) {
    case INBOX_REPLACED:
        bus_count(&counters->replaced, 1);
        break;
    case INBOX_OVERFLOWED:
        bus_count(&counters->overflowed, 1);
        return;
    case INBOX_WRONG_SIZE:
        bus_count(&counters->wrong_size, 1);
        return;
    case INBOX_MISFIT:
        bus_count(&counters->misfits, 1);
        return;
    default:
        break;
    }
    if (!bus->inboxes[input].quiet) {
        bus_notify(bus);
    }
}

static void on_sample(void *ctx, uint32_t number, const uint8_t *bytes, size_t size)
{
    fcsl_bus_t *bus = ctx;
    if (number < bus->input_count) {
        put(bus, number, bytes, size);
    }
}

static void on_stray(void *ctx)
{
    bus_count(&((fcsl_bus_t *)ctx)->counters.strays, 1);
}

static void on_matching(void *ctx, uint32_t number, int matching)
{
    fcsl_bus_t *bus = ctx;
    if (number < bus->output_count) {
        atomic_store(&bus->matched[number], matching);
        bus_notify(bus);
    }
}

static void on_tokens(void *ctx, uint32_t number, uint32_t count)
{
    fcsl_bus_t *bus = ctx;
    if (number < bus->watched_count) {
        atomic_store(&bus->token_counts[number], count);
        bus_notify(bus);
    }
}

static void on_release(void *ctx)
{
    bus_disown(ctx);
}

fcsl_zenoh_events_t bus_events(fcsl_bus_t *bus)
{
    return (fcsl_zenoh_events_t){.ctx = bus,
                                 .sample = on_sample,
                                 .stray = on_stray,
                                 .matching = on_matching,
                                 .tokens = on_tokens,
                                 .release = on_release};
}
