/* SPDX-License-Identifier: Apache-2.0
 *
 * What a twin's tick(n) is compared with: the bare step of the same machine, called in a loop.
 */
#include "fcsl/fcsl_machine.h"

#define EXPORTED __attribute__((visibility("default")))

EXPORTED void twin_loop(const fcsl_machine_t *machine, void *data, uint64_t ticks);

void twin_loop(const fcsl_machine_t *machine, void *data, uint64_t ticks)
{
    const fcsl_host_t host = {0};
    for (uint64_t i = 0; i < ticks; i++) {
        machine->step(data, &host);
    }
}
