/* SPDX-License-Identifier: Apache-2.0
 *
 * Generated C under the sanitizers: every machine of the program, for as many ticks as the argument says, under the stimulus.
 * Prints a hash per machine, which is also that of the same machine without a sanitizer.
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>

#include "stimulus.h"

static const uint64_t SEED = 1;

static int run_machine(const fcsl_machine_t *d, uint64_t ticks)
{
    void *machine = aligned_alloc(d->align, ((size_t)d->size + d->align - 1u) / d->align * d->align);
    if (machine == NULL) {
        return -1;
    }
    d->init(machine);
    if (d->start(machine) != 0) {
        free(machine);
        return -1;
    }
    stimulus_host_t host;
    uint64_t hash = 0;
    stimulus_begin(d, machine);
    stimulus_host_begin(&host, SEED);
    for (uint64_t tick = 0; tick < ticks; tick++) {
        host.tick = tick;
        stimulus_tick(d, machine, tick, SEED);
        d->step(machine, &host.host);
        hash = stimulus_hash(d, machine, hash);
    }
    (void)printf("%s %016" PRIx64 "\n", d->name, hash);
    free(machine);
    return 0;
}

int main(int argc, char **argv)
{
    const uint64_t ticks = argc == 2 ? strtoull(argv[1], NULL, 10) : 0;
    for (size_t i = 0; fcsl_machines[i] != NULL; i++) {
        if (run_machine(fcsl_machines[i], ticks) != 0) {
            (void)fprintf(stderr, "%s: cannot be started\n", fcsl_machines[i]->name);
            return 1;
        }
    }
    return ticks > 0 ? 0 : 2;
}
