/* SPDX-License-Identifier: Apache-2.0
 *
 * Requests that transitions have lost to others.
 */
#ifndef FCSL_LOST_REQUESTS_H
#define FCSL_LOST_REQUESTS_H

#include "fcsl/fcsl_machine.h"

/* Holds "HOVER -> SAFE: ABORT": a validated descriptor has names of at most 255 bytes. */
enum { FCSL_LOST_REQUEST_BYTES = 1024 };

typedef struct {
    uint64_t count; /* of all transitions with this name */
    char name[FCSL_LOST_REQUEST_BYTES];
} fcsl_lost_request_t;

/* Finds the first name from transition `*next` on that has lost requests in `data`, a machine struct, and leaves in `*next` where
 * to go on. Returns 0 where there is none any more. */
int fcsl_lost_request_next(const fcsl_machine_t *machine, const uint8_t *data, uint32_t *next,
                           fcsl_lost_request_t *found);

#endif /* FCSL_LOST_REQUESTS_H */
