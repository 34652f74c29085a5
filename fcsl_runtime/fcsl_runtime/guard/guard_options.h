/* SPDX-License-Identifier: Apache-2.0 */
#ifndef GUARD_OPTIONS_H
#define GUARD_OPTIONS_H

#include <stdint.h>

typedef struct {
    const char *library;
    const char *machine; /* null: the only one */
    const char *slot;    /* path of the socket on which the flight program gets the slot */
    const char **actuators; /* texts of --actuator */
    uint32_t actuator_count;
    const char *board; /* file of the board's plan, in the place of actuators; null: none */
    uint64_t period_ms;
    uint64_t priority; /* of SCHED_FIFO; 0: as started */
    int lock_memory;
} options_t;

/* Reads the command line. Returns 0; 1 when help or version was printed; -1 after a message. */
int options_read(int argc, char **argv, options_t *options);
void options_free(options_t *options);

#endif /* GUARD_OPTIONS_H */
