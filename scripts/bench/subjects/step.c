/* SPDX-License-Identifier: Apache-2.0
 *
 * Times `step` of the compiled lander against the same logic written by hand, side by side on one recorded flight:
 *   step LIBRARY SAMPLES REPEATS        SAMPLES: doubles (pos_z, vel_z) per tick
 * Rounds of the two alternate, so that whatever else the machine does hits both. Prints medians as JSON, the quartiles of
 * their ratio, and how far the two throttles ever lay apart. The compiled machine is driven as a host does it: through its descriptor.
 */
#include "lander_by_hand.h"
#include "timing.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct {
    const fcsl_machine_t *machine;
    unsigned char *data;
    uint32_t pos, vel, throttle;
    const double *samples;
    long ticks;
} flight_t;

static double fly_compiled(flight_t *f, double *throttle)
{
    const fcsl_host_t host = {0};
    f->machine->init(f->data);
    if (f->machine->start(f->data) != 0) {
        fprintf(stderr, "step: start failed\n");
        exit(1);
    }
    double begun = now_ns();
    for (long k = 0; k < f->ticks; ++k) {
        memcpy(f->data + f->pos, &f->samples[2 * k], sizeof(double));
        memcpy(f->data + f->vel, &f->samples[2 * k + 1], sizeof(double));
        f->machine->step(f->data, &host);
        memcpy(&throttle[k], f->data + f->throttle, sizeof(double));
    }
    return (now_ns() - begun) / (double)f->ticks;
}

static double fly_by_hand(const flight_t *f, double *throttle)
{
    lander_by_hand_t l;
    lander_by_hand_init(&l);
    double begun = now_ns();
    for (long k = 0; k < f->ticks; ++k) {
        lander_by_hand_step(&l, f->samples[2 * k], f->samples[2 * k + 1]);
        throttle[k] = l.throttle;
    }
    return (now_ns() - begun) / (double)f->ticks;
}

static double *read_samples(const char *path, long *ticks)
{
    FILE *file = fopen(path, "rb");
    if (file == NULL || fseek(file, 0, SEEK_END) != 0) {
        fprintf(stderr, "step: cannot read %s\n", path);
        exit(1);
    }
    *ticks = ftell(file) / (long)(2 * sizeof(double));
    rewind(file);
    double *samples = allocate((size_t)*ticks * 2 * sizeof(double));
    if (fread(samples, 2 * sizeof(double), (size_t)*ticks, file) != (size_t)*ticks) {
        fprintf(stderr, "step: cannot read %s\n", path);
        exit(1);
    }
    fclose(file);
    return samples;
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        fprintf(stderr, "usage: step LIBRARY SAMPLES REPEATS\n");
        return 2;
    }
    flight_t f = {.machine = load_machine(argv[1])};
    f.samples = read_samples(argv[2], &f.ticks);
    f.data = new_machine(f.machine);
    f.pos = offset_of(f.machine, "sensors.outputs.pos_z");
    f.vel = offset_of(f.machine, "sensors.outputs.vel_z");
    f.throttle = offset_of(f.machine, "engine.outputs.throttle");
    const int repeats = atoi(argv[3]);
    if (repeats < 1) {
        fprintf(stderr, "usage: step LIBRARY SAMPLES REPEATS\n");
        return 2;
    }
    double *throttle = allocate((size_t)f.ticks * sizeof(double)), *hand = allocate((size_t)f.ticks * sizeof(double));
    double *compiled_ns = allocate((size_t)repeats * sizeof(double));
    double *hand_ns = allocate((size_t)repeats * sizeof(double));
    double *ratio = allocate((size_t)repeats * sizeof(double));
    for (int r = 0; r < repeats; ++r) {
        compiled_ns[r] = fly_compiled(&f, throttle);
        hand_ns[r] = fly_by_hand(&f, hand);
        ratio[r] = compiled_ns[r] / hand_ns[r];
    }
    double apart = 0.0;
    for (long k = 0; k < f.ticks; ++k) {
        apart = fmax(apart, fabs(throttle[k] - hand[k]));
    }
    const spread_t of = spread(ratio, repeats);
    printf("{\"ticks\": %ld, \"repeats\": %d, \"compiled_ns\": %.2f, \"by_hand_ns\": %.2f, \"ratio\": %.4f, "
           "\"ratio_low\": %.4f, \"ratio_high\": %.4f, \"throttle_apart\": %.3g}\n",
           f.ticks, repeats, median(compiled_ns, repeats), median(hand_ns, repeats), of.median, of.low, of.high, apart);
    return 0;
}
