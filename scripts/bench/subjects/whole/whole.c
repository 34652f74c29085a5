/* SPDX-License-Identifier: Apache-2.0
 *
 * Times a whole machine against the same logic written by hand, on the same made-up sensors:
 *   whole ROUNDS
 * The candidates take turns, some microseconds each: the machine's step, its execute bodies with what connects them and
 * without (whole.h), the step by hand. A round has each of them once, what is compared is taken from one round, and reported
 * are medians and quartiles over the rounds: a change of the clock, or something else that runs, hits all or spoils one round.
 * Instructions of the same are counted exactly. Prints JSON, with how far results ever lay apart.
 */
#include "stepped.h"
#include "timing.h"
#include "whole.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A block is a major cycle of every machine, so that all are alike. The past stays in the first-level cache. */
enum { BLOCK = 100, SETTLING = 4000, ROWS = 64, PAST = 4, LINKS_MAX = 64, COLUMNS_MAX = 64 };

typedef struct {
    double *place[LINKS_MAX];
    uint32_t length[LINKS_MAX];
    size_t count;
} places_t;

/* The candidates; `EMPTY` is what feeding them their sensors takes. */
enum { STEP, CONNECTED, BODIES, BY_HAND, EMPTY, CANDIDATES };

typedef struct {
    void *machine, *connected, *bodies, *by_hand;
    unsigned char *past;
    places_t sensors[CANDIDATES];
    double *ns[CANDIDATES];
} whole_t;

static const fcsl_host_t no_clock = {0};
/* Sensor samples, row by row as by_hand_sensors stands. */
static double samples[ROWS][COLUMNS_MAX];

static places_t places_in_machine(void *data, const whole_link_t *links, size_t count)
{
    places_t p = {.count = count};
    for (size_t i = 0; i < count; ++i) {
        p.place[i] = (double *)((unsigned char *)data + offset_of(whole_machine, links[i].path));
        p.length[i] = links[i].count;
    }
    return p;
}

static places_t places_by_hand(void *data, const whole_link_t *links, size_t count)
{
    places_t p = {.count = count};
    for (size_t i = 0; i < count; ++i) {
        p.place[i] = (double *)((unsigned char *)data + links[i].offset);
        p.length[i] = links[i].count;
    }
    return p;
}

static void sense(const places_t *p, uint64_t tick)
{
    const double *row = samples[tick % ROWS];
    for (size_t i = 0; i < p->count; ++i) {
        double *const place = p->place[i];
        for (uint32_t k = 0; k < p->length[i]; ++k) {
            __asm__("" ::: "memory"); /* no memcpy, which would cost more than these few words */
            place[k] = *row++;
        }
    }
}

static void make_samples(void)
{
    uint64_t bits = 88172645463325252u;
    for (size_t r = 0; r < ROWS; ++r) {
        size_t column = 0;
        for (size_t i = 0; i < by_hand_sensor_count; ++i) {
            for (uint32_t k = 0; k < by_hand_sensors[i].count; ++k) {
                bits ^= bits << 13;
                bits ^= bits >> 7;
                bits ^= bits << 17;
                const double unit = (double)(bits >> 11) / 9007199254740992.0 * 2.0 - 1.0;
                samples[r][column++] = by_hand_sensors[i].mean + by_hand_sensors[i].spread * unit;
            }
        }
    }
}

/* Greatest distance of a result in the machine from that by hand. */
static double apart(const places_t *machine, const places_t *by_hand)
{
    double greatest = 0.0;
    for (size_t i = 0; i < machine->count; ++i) {
        for (uint32_t k = 0; k < machine->length[i]; ++k) {
            const double distance = fabs(machine->place[i][k] - by_hand->place[i][k]);
            greatest = fmax(greatest, isnan(distance) ? DBL_MAX : distance); /* fmax would pass over a NaN */
        }
    }
    return greatest;
}

/* One tick of a candidate, sensors first. */
static inline __attribute__((always_inline)) void tick_of(const whole_t *w, int candidate, uint64_t tick)
{
    sense(&w->sensors[candidate], tick);
    switch (candidate) {
    case STEP:
        whole_machine->step(w->machine, &no_clock);
        break;
    case CONNECTED:
        whole_connected(w->connected, NULL, tick);
        break;
    case BODIES:
        whole_bodies(w->bodies, w->past + tick % PAST * whole_machine->size, tick);
        break;
    case BY_HAND:
        by_hand_step(w->by_hand);
        break;
    default:
        __asm__ volatile("" ::: "memory");
    }
}

static inline __attribute__((always_inline)) double block_ns(const whole_t *w, int candidate, uint64_t tick)
{
    const double begun = now_ns();
    for (uint64_t k = 0; k < BLOCK; ++k) {
        tick_of(w, candidate, tick + k);
    }
    return (now_ns() - begun) / BLOCK;
}

/* Instructions of a candidate in a tick, on average over so many. */
static double instructions(const whole_t *w, int candidate, uint64_t tick, uint64_t count)
{
    const uintptr_t targets[] = {(uintptr_t)whole_machine->step, (uintptr_t)whole_connected, (uintptr_t)whole_bodies,
                                 (uintptr_t)by_hand_step};
    uint64_t sum = 0;
    for (uint64_t k = 0; k < count; ++k) {
        stepped_arm(targets[candidate]);
        tick_of(w, candidate, tick + k);
        sum += stepped.all;
    }
    return (double)sum / (double)count;
}

/* The machine in ticks spread over its major cycle, from a copy of it. */
static unsigned char *remember(const void *machine)
{
    unsigned char *past = allocate((size_t)PAST * whole_machine->size);
    void *copy = new_machine(whole_machine);
    memcpy(copy, machine, whole_machine->size);
    const places_t places = places_in_machine(copy, by_hand_sensors, by_hand_sensor_count);
    for (uint64_t k = 0; k < PAST; ++k) {
        for (uint64_t j = 0; j < BLOCK + 7; ++j) {
            sense(&places, (BLOCK + 7) * k + j);
            whole_machine->step(copy, &no_clock);
        }
        memcpy(past + k * whole_machine->size, copy, whole_machine->size);
    }
    free(copy);
    return past;
}

static whole_t begin(int rounds)
{
    whole_t w = {.machine = new_machine(whole_machine), .bodies = new_machine(whole_machine)};
    w.connected = new_machine(whole_machine);
    w.by_hand = allocate(by_hand_size);
    whole_machine->force_state(w.machine, whole_state);
    by_hand_init(w.by_hand);
    w.sensors[STEP] = places_in_machine(w.machine, by_hand_sensors, by_hand_sensor_count);
    w.sensors[CONNECTED] = places_in_machine(w.connected, by_hand_sensors, by_hand_sensor_count);
    w.sensors[BODIES] = places_in_machine(w.bodies, by_hand_sensors, by_hand_sensor_count);
    w.sensors[BY_HAND] = places_by_hand(w.by_hand, by_hand_sensors, by_hand_sensor_count);
    w.sensors[EMPTY] = w.sensors[BODIES];
    for (int c = 0; c < CANDIDATES; ++c) {
        w.ns[c] = allocate((size_t)rounds * sizeof(double));
    }
    return w;
}

static void print_spread(const char *name, double *values, int count)
{
    const spread_t s = spread(values, count);
    printf("\"%s\": {\"median\": %.4f, \"low\": %.4f, \"high\": %.4f}, ", name, s.median, s.low, s.high);
}

static void report(const whole_t *w, int rounds)
{
    static const char *const names[] = {"step_ns", "connected_ns", "bodies_ns", "by_hand_ns", "sense_ns"};
    enum { FIGURES = 5 };
    static const char *const of[FIGURES] = {"connected_ratio", "bodies_ratio", "besides_connected_ns",
                                            "besides_bodies_ns", "step_ratio"};
    double *figures[FIGURES];
    for (int f = 0; f < FIGURES; ++f) {
        figures[f] = allocate((size_t)rounds * sizeof(double));
    }
    for (int r = 0; r < rounds; ++r) {
        const double step = w->ns[STEP][r], by_hand = w->ns[BY_HAND][r], empty = w->ns[EMPTY][r];
        figures[0][r] = (w->ns[CONNECTED][r] - empty) / (by_hand - empty);
        figures[1][r] = (w->ns[BODIES][r] - empty) / (by_hand - empty);
        figures[2][r] = step - w->ns[CONNECTED][r];
        figures[3][r] = step - w->ns[BODIES][r];
        figures[4][r] = (step - empty) / (by_hand - empty);
    }
    for (int f = 0; f < FIGURES; ++f) {
        print_spread(of[f], figures[f], rounds);
        free(figures[f]);
    }
    for (int c = 0; c < CANDIDATES; ++c) {
        print_spread(names[c], w->ns[c], rounds);
    }
}

int main(int argc, char **argv)
{
    const int rounds = argc == 2 ? atoi(argv[1]) : 0;
    if (rounds < 1 || by_hand_sensor_count > LINKS_MAX || by_hand_result_count > LINKS_MAX) {
        fprintf(stderr, "usage: whole ROUNDS\n");
        return 2;
    }
    make_samples();
    whole_t w = begin(rounds);
    const places_t of_machine = places_in_machine(w.machine, by_hand_results, by_hand_result_count);
    const places_t of_connected = places_in_machine(w.connected, by_hand_results, by_hand_result_count);
    const places_t of_hand = places_by_hand(w.by_hand, by_hand_results, by_hand_result_count);
    double greatest = 0.0, connected = 0.0;
    uint64_t tick = 0;
    for (; tick < SETTLING; ++tick) { /* to where the filters have settled */
        tick_of(&w, STEP, tick);
        tick_of(&w, BY_HAND, tick);
        greatest = fmax(greatest, apart(&of_machine, &of_hand));
    }
    memcpy(w.bodies, w.machine, whole_machine->size);
    memcpy(w.connected, w.machine, whole_machine->size);
    w.past = remember(w.machine);
    for (int r = 0; r < rounds; ++r, tick += BLOCK) {
        w.ns[STEP][r] = block_ns(&w, STEP, tick);
        w.ns[CONNECTED][r] = block_ns(&w, CONNECTED, tick);
        w.ns[BODIES][r] = block_ns(&w, BODIES, tick);
        w.ns[BY_HAND][r] = block_ns(&w, BY_HAND, tick);
        w.ns[EMPTY][r] = block_ns(&w, EMPTY, tick);
        greatest = fmax(greatest, apart(&of_machine, &of_hand));
        connected = fmax(connected, apart(&of_machine, &of_connected));
    }
    const char *const names[] = {"step", "connected", "bodies", "by_hand"};
    printf("{");
    report(&w, rounds);
    if (stepped_begin() != 0) {
        fprintf(stderr, "whole: instructions cannot be counted\n");
        return 1;
    }
    for (int c = STEP; c <= BY_HAND; ++c) {
        printf("\"%s_instructions\": %.2f, ", names[c],
               instructions(&w, c, tick, rounds < BLOCK ? (uint64_t)rounds : BLOCK));
    }
    printf("\"apart\": %.3g, \"connected_apart\": %.3g, \"state_bytes\": %u, \"by_hand_state_bytes\": %zu}\n", greatest,
           connected, whole_machine->size, by_hand_size);
    return 0;
}
