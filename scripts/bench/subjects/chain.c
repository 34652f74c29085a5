/* SPDX-License-Identifier: Apache-2.0
 *
 * Times `step` of chains of trivial instances, and the same chain written by hand:
 *   chain ROUNDS LINKS PLAIN TIMED …      per size: the machine as it is, and with max_wcet_us on every instance
 * Every round takes each of them once, so that whatever else the computer does hits all. The machines are driven as a
 * host does it: through their descriptors. The clock of the timed ones does nothing but count, so that its readings are
 * exact and their cost is the least a clock can have. Prints medians as JSON.
 */
#include "chain_by_hand.h"
#include "timing.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* Links that one measurement runs through: some 100 µs. */
enum { LINKS_PER_SAMPLE = 60000, SIZES_MAX = 8 };

typedef struct {
    int links;
    const fcsl_machine_t *plain, *timed;
    void *plain_data, *timed_data;
    link_t *by_hand_data;
    chain_t by_hand;
    uint64_t reads;
    double *plain_ns, *timed_ns, *clock_ns, *unclocked_ns, *by_hand_ns;
} chain_case_t;

static uint64_t count(void *ctx)
{
    uint64_t *reads = ctx;
    *reads += 1u;
    return *reads;
}

static double step(const chain_case_t *c, const fcsl_machine_t *machine, void *data, const fcsl_host_t *host)
{
    const int steps = LINKS_PER_SAMPLE / c->links;
    const double begun = now_ns();
    for (int i = 0; i < steps; ++i) {
        machine->step(data, host);
    }
    return (now_ns() - begun) / steps;
}

/* One reading of the clock, as a machine makes it. */
static double read_clock(const fcsl_host_t *host)
{
    uint64_t (*volatile const clock_ns)(void *) = host->clock_ns;
    const double begun = now_ns();
    for (int i = 0; i < LINKS_PER_SAMPLE; ++i) {
        (void)clock_ns(host->ctx);
    }
    return (now_ns() - begun) / LINKS_PER_SAMPLE;
}

static double step_by_hand(const chain_case_t *c)
{
    const int steps = LINKS_PER_SAMPLE / c->links;
    const double begun = now_ns();
    for (int i = 0; i < steps; ++i) {
        c->by_hand(c->by_hand_data);
    }
    return (now_ns() - begun) / steps;
}

static void open_case(chain_case_t *c, char **arguments, int rounds)
{
    *c = (chain_case_t){.links = atoi(arguments[0])};
    c->by_hand = chain_by_hand(c->links);
    if (c->by_hand == NULL) {
        fprintf(stderr, "chain: no chain of %s by hand\n", arguments[0]);
        exit(2);
    }
    c->plain = load_machine(arguments[1]);
    c->timed = load_machine(arguments[2]);
    c->plain_data = new_machine(c->plain);
    c->timed_data = new_machine(c->timed);
    c->by_hand_data = allocate((size_t)c->links * sizeof(link_t));
    memset(c->by_hand_data, 0, (size_t)c->links * sizeof(link_t));
    double **columns[] = {&c->plain_ns, &c->timed_ns, &c->clock_ns, &c->unclocked_ns, &c->by_hand_ns};
    for (size_t i = 0; i < sizeof columns / sizeof *columns; ++i) {
        *columns[i] = allocate((size_t)rounds * sizeof(double));
    }
}

/* The last link says whether all of them ran. */
static double result_of(const fcsl_machine_t *machine, const void *data, int links)
{
    char path[64];
    double value = 0.0;
    snprintf(path, sizeof path, "link%d.outputs.y", links - 1);
    memcpy(&value, (const unsigned char *)data + offset_of(machine, path), sizeof value);
    return value;
}

static void report(chain_case_t *c, int rounds, int is_last)
{
    const double y[] = {result_of(c->plain, c->plain_data, c->links), result_of(c->timed, c->timed_data, c->links),
                        c->by_hand_data[c->links - 1].y};
    for (size_t i = 0; i < sizeof y / sizeof *y; ++i) {
        if (y[i] != (double)c->links) {
            fprintf(stderr, "chain: a chain of %d gave %g\n", c->links, y[i]);
            exit(1);
        }
    }
    const uint64_t steps = (uint64_t)(LINKS_PER_SAMPLE / c->links) * (uint64_t)rounds;
    const double reads = (double)c->reads / (double)steps;
    double *ratio = allocate((size_t)rounds * sizeof(double)), *besides = allocate((size_t)rounds * sizeof(double));
    for (int r = 0; r < rounds; ++r) { /* what is compared is of one round */
        ratio[r] = c->plain_ns[r] / c->by_hand_ns[r];
        besides[r] = (c->timed_ns[r] - c->plain_ns[r] - reads * c->clock_ns[r]) / c->links;
    }
    const spread_t to_hand = spread(ratio, rounds), each = spread(besides, rounds);
    printf("{\"ratio\": {\"median\": %.4f, \"low\": %.4f, \"high\": %.4f}, "
           "\"besides_ns\": {\"median\": %.4f, \"low\": %.4f, \"high\": %.4f}, ",
           to_hand.median, to_hand.low, to_hand.high, each.median, each.low, each.high);
    printf("\"links\": %d, \"plain_ns\": %.3f, \"timed_ns\": %.3f, \"clock_ns\": %.3f, \"unclocked_ns\": %.3f, "
           "\"by_hand_ns\": %.3f, "
           "\"reads_per_step\": %.6f, \"state_bytes\": %u}%s\n",
           c->links, median(c->plain_ns, rounds), median(c->timed_ns, rounds), median(c->clock_ns, rounds),
           median(c->unclocked_ns, rounds), median(c->by_hand_ns, rounds), reads, c->plain->size, is_last ? "" : ",");
    free(ratio);
    free(besides);
}

int main(int argc, char **argv)
{
    const int rounds = argc > 1 ? atoi(argv[1]) : 0, sizes = (argc - 2) / 3;
    if (rounds < 1 || sizes < 1 || sizes > SIZES_MAX || argc != 2 + 3 * sizes) {
        fprintf(stderr, "usage: chain ROUNDS LINKS PLAIN TIMED …\n");
        return 2;
    }
    chain_case_t cases[SIZES_MAX];
    for (int i = 0; i < sizes; ++i) {
        open_case(&cases[i], argv + 2 + 3 * i, rounds);
    }
    const fcsl_host_t no_clock = {0};
    uint64_t other_reads = 0;
    for (int r = 0; r < rounds; ++r) {
        for (int i = 0; i < sizes; ++i) {
            chain_case_t *c = &cases[i];
            const fcsl_host_t clock = {.ctx = &c->reads, .clock_ns = count};
            c->plain_ns[r] = step(c, c->plain, c->plain_data, &no_clock);
            c->timed_ns[r] = step(c, c->timed, c->timed_data, &clock);
            c->clock_ns[r] = read_clock(&(const fcsl_host_t){.ctx = &other_reads, .clock_ns = count});
            c->unclocked_ns[r] = step(c, c->timed, c->timed_data, &no_clock);
            c->by_hand_ns[r] = step_by_hand(c);
        }
    }
    printf("[");
    for (int i = 0; i < sizes; ++i) {
        report(&cases[i], rounds, i + 1 == sizes);
    }
    printf("]\n");
    return 0;
}
