/* SPDX-License-Identifier: Apache-2.0
 *
 * The machine's topics on a session of the bus, fed with every tick.
 */
#define _GNU_SOURCE
#include "fcsl/fcsl_monotonic.h"
#include "fcsl/fcsl_ros_graph.h"

#include <stdlib.h>
#include <time.h>

#include "fcsl/fcsl_error.h"
#include "observers/history_reader.h"
#include "ros_topics.h"
#include "fcsl/fcsl_tick_time.h"

enum {
    TICKS_POSTED = 64, /* at most, before all of them must have left */
    TICKS_SPARE = 2,   /* one that is leaving, and what is lost where the ring ends */
    ENTRY_BYTES_MAX = 16, /* of the ring, beside a message */
    CLOSE_MS = 2000
};
/* Fewer ticks are posted at a time where these would take more. */
static const uint64_t RING_BYTES = UINT64_C(4) << 20;

struct fcsl_ros_graph {
    history_reader_t reader;
    ros_topics_t topics;
    fcsl_bus_t *bus; /* its outputs are the topics */
    uint8_t *message; /* the longest */
    int simulated;
    uint32_t ring_ticks; /* that the ring holds */
    uint32_t room;       /* of them, free for certain */
    uint64_t completed;  /* ticks, in the last publication */
};

/* ---- a tick --------------------------------------------------------------------------------------------------------- */

/* Latched topics keep up while nobody subscribes, for who does later. */
static int wants_all(void *ctx)
{
    (void)ctx;
    return 1;
}

static void skip_none(void *ctx)
{
    (void)ctx;
}

/* Once everything has left, the ring holds as many ticks as it was made for. */
static int is_ready(void *ctx)
{
    fcsl_ros_graph_t *g = ctx;
    if (g->room == 0u) {
        fcsl_bus_counters_t now;
        fcsl_bus_count(g->bus, &now);
        g->room = now.posted == now.put + now.put_failed ? g->ring_ticks : 0u;
    }
    return g->room > 0u;
}

static uint64_t clock_ns(clockid_t clock)
{
    struct timespec now;
    (void)clock_gettime(clock, &now);
    return (uint64_t)now.tv_sec * 1000000000u + (uint64_t)now.tv_nsec;
}

/* When the tick was: its own time, or that of the system's clock at which it began. */
static uint64_t time_of(const fcsl_ros_graph_t *g, const published_tick_t *tick)
{
    if (g->simulated) {
        return fcsl_tick_time_ns(g->topics.machine->tick_hz, tick->number);
    }
    return clock_ns(CLOCK_REALTIME) - (fcsl_monotonic_ns() - tick->begun_ns);
}

/* The messages of the first `count` topics. Returns 0, or -1: one found no room. */
static int post(fcsl_ros_graph_t *g, const published_tick_t *tick, uint32_t count)
{
    const fcsl_stamp_t stamp = {.tick = tick->number, .time_ns = time_of(g, tick)};
    int failed = 0;
    g->room--;
    for (uint32_t i = 0; i < count; i++) {
        if (i >= g->topics.latched_count && !fcsl_bus_matched(g->bus, i)) {
            ros_topics_skip(&g->topics, i);
            continue;
        }
        for (uint32_t n = 0; n < g->topics.topics[i].most; n++) {
            const size_t size = ros_topics_write(&g->topics, i, tick, stamp, g->message);
            if (size == 0u) {
                break;
            }
            if (fcsl_bus_post(g->bus, i, g->message, size) != 0) {
                ros_topics_unsay(&g->topics, i);
                failed = 1;
                break;
            }
        }
    }
    return failed ? -1 : 0;
}

static int put(void *ctx, const published_tick_t *tick)
{
    fcsl_ros_graph_t *g = ctx;
    return post(g, tick, g->topics.count);
}

/* What a command changes between ticks is told at once, by the latched topics; the host may be paused. */
static void see(void *ctx, const fcsl_moment_t *moment, const uint8_t *publication)
{
    fcsl_ros_graph_t *g = ctx;
    if (moment->tick == g->completed) {
        const published_tick_t tick = {.publication = publication,
                                       .number = moment->tick > 0u ? moment->tick - 1u : 0u,
                                       .begun_ns = moment->time_ns,
                                       .requires_arming = moment->requires_arming != 0u};
        (void)post(g, &tick, g->topics.latched_count); /* without room the next tick tells of it */
    }
    g->completed = moment->tick;
}

/* ---- opening and closing -------------------------------------------------------------------------------------------- */

/* The ring's bytes, and how many ticks it holds; *longest becomes the bytes of the longest message. */
static uint32_t size_ring(fcsl_ros_graph_t *g, size_t *longest)
{
    uint64_t tick_bytes = 0;
    *longest = 0;
    for (uint32_t i = 0; i < g->topics.count; i++) {
        const uint32_t bytes = g->topics.topics[i].longest;
        tick_bytes += (uint64_t)g->topics.topics[i].most * (bytes + ENTRY_BYTES_MAX);
        *longest = bytes > *longest ? bytes : *longest;
    }
    const uint64_t ticks = RING_BYTES / tick_bytes;
    g->ring_ticks = ticks < 1u ? 1u : ticks > TICKS_POSTED ? TICKS_POSTED : (uint32_t)ticks;
    const uint64_t bytes = tick_bytes * (g->ring_ticks + TICKS_SPARE);
    return bytes < UINT32_MAX ? (uint32_t)bytes : UINT32_MAX; /* the bus refuses so many */
}

static int open_session(fcsl_ros_graph_t *g, fcsl_error_t *error)
{
    fcsl_error_t reason;
    size_t longest = 0;
    const uint32_t count = g->topics.count;
    const uint32_t ring_bytes = size_ring(g, &longest);
    const char **keys = calloc(2u * count + 1u, sizeof *keys);
    g->message = malloc(longest);
    if (keys == NULL || g->message == NULL) {
        free((void *)keys);
        return fcsl_fail(error, "out of memory for the ROS 2 graph");
    }
    for (uint32_t i = 0; i < count; i++) {
        keys[i] = g->topics.topics[i].endpoint.key;
        keys[count + i] = g->topics.topics[i].endpoint.token;
    }
    const fcsl_bus_options_t options = {
        .ring_bytes = ring_bytes, .outputs = keys, .output_count = count, .latched_count = g->topics.latched_count};
    const int failed = ros_session_open(&g->topics.place, &options, keys + count, count, &g->bus, &reason);
    free((void *)keys);
    return failed ? fcsl_fail(error, "no ROS 2 graph: %s", reason.text) : 0;
}

fcsl_ros_graph_t *fcsl_ros_graph_open(const fcsl_ros_graph_options_t *options, const fcsl_history_t *history,
                                      fcsl_error_t *error)
{
    fcsl_ros_graph_t *g = calloc(1, sizeof *g);
    if (g == NULL) {
        (void)fcsl_fail(error, "out of memory for the ROS 2 graph");
        return NULL;
    }
    const history_reader_sink_t sink = {
        .ctx = g, .wants = wants_all, .skip = skip_none, .ready = is_ready, .observe = see, .put = put};
    g->simulated = options->simulated;
    if (history_reader_open(&g->reader, history, fcsl_run_machine(options->run)->tick_hz, &sink) != 0) {
        (void)fcsl_fail(error, "out of memory for the ROS 2 graph");
    } else if (ros_topics_build(&g->topics, options, error) == 0 && open_session(g, error) == 0) {
        return g;
    }
    fcsl_ros_graph_close(g);
    return NULL;
}

int fcsl_ros_graph_start(fcsl_ros_graph_t *graph, fcsl_error_t *error)
{
    return history_reader_start(&graph->reader, error);
}

void fcsl_ros_graph_stop(fcsl_ros_graph_t *graph)
{
    if (graph != NULL) {
        history_reader_stop(&graph->reader);
    }
}

void fcsl_ros_graph_close(fcsl_ros_graph_t *graph)
{
    if (graph == NULL) {
        return;
    }
    history_reader_close(&graph->reader);
    if (graph->bus != NULL) {
        (void)fcsl_bus_close(graph->bus,
                             CLOSE_MS); /* a frozen bridge may hold it up: what is left of it goes on alone */
    }
    ros_topics_free(&graph->topics);
    free(graph->message);
    free(graph);
}

void fcsl_ros_graph_count(const fcsl_ros_graph_t *graph, fcsl_ros_graph_counters_t *counters)
{
    *counters =
        (fcsl_ros_graph_counters_t){.ticks = history_reader_ticks(&graph->reader),
                                    .dropped = history_reader_dropped(&graph->reader),
                                    .refused = atomic_load_explicit(&graph->topics.refused, memory_order_relaxed)};
}

void fcsl_ros_graph_stats(const fcsl_ros_graph_t *graph, fcsl_vars_out_t *out)
{
    fcsl_ros_graph_counters_t counters;
    fcsl_ros_graph_count(graph, &counters);
    fcsl_vars_begin(out, "ros");
    fcsl_vars_number(out, "ticks", counters.ticks);
    fcsl_vars_number(out, "dropped", counters.dropped);
    fcsl_vars_number(out, "refused", counters.refused);
    fcsl_vars_end(out);
}
