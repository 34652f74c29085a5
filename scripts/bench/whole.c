/* SPDX-License-Identifier: Apache-2.0
 *
 * Times a whole machine against the same logic written by hand, on the same made-up sensors:
 *   whole ROUNDS
 * Three things in turn, round by round: the machine's step, its execute bodies called directly (on inputs that it had in
 * some ticks before), the step by hand. What the machine does besides its bodies is the difference of the first two. Prints medians as JSON, and how far the results
 * of the two ever lay apart.
 */
#include "timing.h"
#include "whole.h"

#include <float.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* A multiple of every machine's major cycle. */
enum { TICKS_PER_SAMPLE = 4000, ROWS = 64, PAST = 16, LINKS_MAX = 64, COLUMNS_MAX = 64 };

typedef struct {
    unsigned char *place[LINKS_MAX];
    size_t size[LINKS_MAX];
    size_t count;
} places_t;

/* Sensor samples, row by row as by_hand_sensors stands. */
static double samples[ROWS][COLUMNS_MAX];

static places_t places_in_machine(void *data, const whole_link_t *links, size_t count)
{
    places_t p = {.count = count};
    for (size_t i = 0; i < count; ++i) {
        p.place[i] = (unsigned char *)data + offset_of(whole_machine, links[i].path);
        p.size[i] = links[i].count * sizeof(double);
    }
    return p;
}

static places_t places_by_hand(void *data, const whole_link_t *links, size_t count)
{
    places_t p = {.count = count};
    for (size_t i = 0; i < count; ++i) {
        p.place[i] = (unsigned char *)data + links[i].offset;
        p.size[i] = links[i].count * sizeof(double);
    }
    return p;
}

static void sense(const places_t *p, uint64_t tick)
{
    const double *row = samples[tick % ROWS];
    for (size_t i = 0; i < p->count; ++i) {
        memcpy(p->place[i], row, p->size[i]);
        row += p->size[i] / sizeof(double);
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
        for (size_t k = 0; k < machine->size[i]; k += sizeof(double)) {
            double a = 0.0, b = 0.0;
            memcpy(&a, machine->place[i] + k, sizeof a);
            memcpy(&b, by_hand->place[i] + k, sizeof b);
            const double distance = fabs(a - b);
            greatest = fmax(greatest, isnan(distance) ? DBL_MAX : distance); /* fmax would pass over a NaN */
        }
    }
    return greatest;
}

/* The machine in ticks spread over its major cycle, from a copy of it. */
static unsigned char *remember(const void *machine, const places_t *sensors, const fcsl_host_t *host)
{
    unsigned char *past = allocate((size_t)PAST * whole_machine->size);
    void *copy = allocate(whole_machine->size);
    memcpy(copy, machine, whole_machine->size);
    places_t places = *sensors;
    for (size_t i = 0; i < places.count; ++i) {
        places.place[i] = (unsigned char *)copy + (sensors->place[i] - (const unsigned char *)machine);
    }
    for (uint64_t k = 0; k < PAST; ++k) {
        for (uint64_t j = 0; j < 100; ++j) {
            sense(&places, 100 * k + j);
            whole_machine->step(copy, host);
        }
        memcpy(past + k * whole_machine->size, copy, whole_machine->size);
    }
    free(copy);
    return past;
}

int main(int argc, char **argv)
{
    const int rounds = argc == 2 ? atoi(argv[1]) : 0;
    if (rounds < 1 || by_hand_sensor_count > LINKS_MAX || by_hand_result_count > LINKS_MAX) {
        fprintf(stderr, "usage: whole ROUNDS\n");
        return 2;
    }
    make_samples();
    const fcsl_host_t host = {0};
    void *machine = new_machine(whole_machine), *bodies = new_machine(whole_machine);
    unsigned char *by_hand = allocate(by_hand_size);
    whole_machine->force_state(machine, whole_state);
    by_hand_init(by_hand);
    const places_t to_machine = places_in_machine(machine, by_hand_sensors, by_hand_sensor_count);
    const places_t to_bodies = places_in_machine(bodies, by_hand_sensors, by_hand_sensor_count);
    const places_t to_hand = places_by_hand(by_hand, by_hand_sensors, by_hand_sensor_count);
    const places_t of_machine = places_in_machine(machine, by_hand_results, by_hand_result_count);
    const places_t of_hand = places_by_hand(by_hand, by_hand_results, by_hand_result_count);
    double *step_ns = allocate((size_t)rounds * sizeof(double)), *bodies_ns = allocate((size_t)rounds * sizeof(double));
    double *by_hand_ns = allocate((size_t)rounds * sizeof(double)),
           *sense_ns = allocate((size_t)rounds * sizeof(double));
    double greatest = 0.0;
    uint64_t tick = 0;
    for (uint64_t k = 0; k < TICKS_PER_SAMPLE; ++k) { /* to where the filters have settled */
        sense(&to_machine, k);
        sense(&to_hand, k);
        whole_machine->step(machine, &host);
        by_hand_step(by_hand);
        greatest = fmax(greatest, apart(&of_machine, &of_hand));
    }
    memcpy(bodies, machine, whole_machine->size);
    unsigned char *past = remember(machine, &to_machine, &host);
    for (int r = 0; r < rounds; ++r, tick += TICKS_PER_SAMPLE) {
        double begun = now_ns();
        for (uint64_t k = 0; k < TICKS_PER_SAMPLE; ++k) {
            sense(&to_machine, tick + k);
            whole_machine->step(machine, &host);
        }
        step_ns[r] = (now_ns() - begun) / TICKS_PER_SAMPLE;
        begun = now_ns();
        for (uint64_t k = 0; k < TICKS_PER_SAMPLE; ++k) {
            sense(&to_bodies, tick + k);
            whole_bodies(bodies, past + (tick + k) % PAST * whole_machine->size, tick + k);
        }
        bodies_ns[r] = (now_ns() - begun) / TICKS_PER_SAMPLE;
        begun = now_ns();
        for (uint64_t k = 0; k < TICKS_PER_SAMPLE; ++k) {
            sense(&to_hand, tick + k);
            by_hand_step(by_hand);
        }
        by_hand_ns[r] = (now_ns() - begun) / TICKS_PER_SAMPLE;
        begun = now_ns();
        for (uint64_t k = 0; k < TICKS_PER_SAMPLE; ++k) {
            sense(&to_bodies, tick + k);
            __asm__ volatile("" ::: "memory");
        }
        sense_ns[r] = (now_ns() - begun) / TICKS_PER_SAMPLE;
        greatest = fmax(greatest, apart(&of_machine, &of_hand));
    }
    printf("{\"step_ns\": %.2f, \"bodies_ns\": %.2f, \"by_hand_ns\": %.2f, \"sense_ns\": %.2f, \"apart\": %.3g, "
           "\"state_bytes\": %u, \"by_hand_state_bytes\": %zu}\n",
           median(step_ns, rounds), median(bodies_ns, rounds), median(by_hand_ns, rounds), median(sense_ns, rounds),
           greatest, whole_machine->size, by_hand_size);
    return 0;
}
