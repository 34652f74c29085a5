/* SPDX-License-Identifier: Apache-2.0
 *
 * A tick of one machine, built by two backends, in turns:
 *   backends LIBRARY LIBRARY STATE ROUNDS     ns of a step of each, in the state with this number
 * Prints JSON.
 */
#include "timing.h"

#include <stdio.h>
#include <stdlib.h>

enum { REPEATS = 500, BACKENDS = 2 };

int main(int argc, char **argv)
{
    static const char *const names[BACKENDS] = {"c", "nim"};
    if (argc != 5) {
        fprintf(stderr, "usage: backends LIBRARY LIBRARY STATE ROUNDS\n");
        return 2;
    }
    const int32_t state = atoi(argv[3]);
    const int rounds = atoi(argv[4]);
    const fcsl_host_t host = {0};
    const fcsl_machine_t *machines[BACKENDS];
    void *memory[BACKENDS];
    double *times[BACKENDS];
    double *ratios = allocate((size_t)rounds * sizeof *ratios);
    for (int b = 0; b < BACKENDS; b++) {
        machines[b] = load_machine(argv[1 + b]);
        memory[b] = new_machine(machines[b]);
        times[b] = allocate((size_t)rounds * sizeof **times);
    }
    for (int i = 0; i < rounds; i++) {
        for (int turn = 0; turn < BACKENDS; turn++) {
            const int b = (i + turn) % BACKENDS; /* neither is always the first */
            machines[b]->force_state(memory[b], state);
            const double begun = now_ns();
            for (int n = 0; n < REPEATS; n++) {
                machines[b]->step(memory[b], &host);
            }
            times[b][i] = (now_ns() - begun) / REPEATS;
        }
        ratios[i] = times[1][i] / times[0][i];
    }
    printf("{");
    for (int b = 0; b < BACKENDS; b++) {
        const spread_t found = spread(times[b], rounds);
        printf("\"%s_ns\": %.1f, \"%s_low_ns\": %.1f, \"%s_high_ns\": %.1f, ", names[b], found.median, names[b],
               found.low, names[b], found.high);
    }
    const spread_t ratio = spread(ratios, rounds);
    printf("\"ratio\": %.3f, \"ratio_low\": %.3f, \"ratio_high\": %.3f}\n", ratio.median, ratio.low, ratio.high);
    return 0;
}
