/* SPDX-License-Identifier: Apache-2.0
 *
 * Three slots: fcsl_latest.h says why that is enough.
 */
#include "fcsl/fcsl_latest.h"

#include <stdlib.h>

enum { SLOT = 3, FRESH = 4 };

int fcsl_latest_open(fcsl_latest_t *latest, size_t size)
{
    *latest = (fcsl_latest_t){.slots = calloc(FCSL_LATEST_SLOTS, size), .slot_size = size, .back = 0, .front = 1};
    atomic_init(&latest->middle, 2u);
    return latest->slots != NULL ? 0 : -1;
}

void fcsl_latest_close(fcsl_latest_t *latest)
{
    free(latest->slots);
    latest->slots = NULL;
}

void *fcsl_latest_back(const fcsl_latest_t *latest)
{
    return latest->slots + latest->back * latest->slot_size;
}

int fcsl_latest_put(fcsl_latest_t *latest)
{
    latest->numbers[latest->back] = ++latest->puts;
    const uint32_t before = atomic_exchange_explicit(&latest->middle, latest->back | FRESH, memory_order_acq_rel);
    latest->back = before & SLOT;
    return (before & FRESH) == 0u;
}

uint64_t fcsl_latest_take(fcsl_latest_t *latest)
{
    if ((atomic_load_explicit(&latest->middle, memory_order_relaxed) & FRESH) == 0u) {
        return 0;
    }
    latest->front = atomic_exchange_explicit(&latest->middle, latest->front, memory_order_acq_rel) & SLOT;
    return latest->numbers[latest->front];
}

const void *fcsl_latest_front(const fcsl_latest_t *latest)
{
    return latest->slots + latest->front * latest->slot_size;
}
