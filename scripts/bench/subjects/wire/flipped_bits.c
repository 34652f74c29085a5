/* SPDX-License-Identifier: Apache-2.0
 *
 * A stream of messages whose bits flip.
 */
#include "flipped_bits.h"

#include "timing.h"
#include "values.h"

#include <math.h>
#include <stdlib.h>

/* Bits up to the next one that flips: geometric. */
static size_t gap(uint64_t *state, double probability)
{
    const double uniform = ((double)(next_random(state) >> 11) + 0.5) / 9007199254740992.0;
    return (size_t)(log(uniform) / log1p(-probability));
}

flipped_t under_flipped_bits(const format_t *format, long messages, double probability)
{
    uint8_t *stream = allocate((size_t)messages * MESSAGE_MAX);
    uint64_t state = 1;
    size_t size = 0;
    flipped_t found = {0};
    format->reset();
    for (long i = 0; i < messages; i++) {
        const values_t values = values_of(FIRST_TICK + (uint64_t)i);
        size += format->encode(SENSORS, &values, stream + size);
    }
    for (size_t bit = gap(&state, probability); bit < 8u * size; bit += 1u + gap(&state, probability)) {
        stream[bit / 8u] ^= (uint8_t)(1u << bit % 8u);
    }
    uint64_t last = 0;
    for (size_t at = 0; at < size;) {
        values_t values = {0};
        int accepted = 0;
        at += format->decode(SENSORS, stream + at, size - at, &values, &accepted);
        const values_t right = values_of(values.tick);
        if (accepted && values.tick > last && equal_values(SENSORS, &values, &right)) {
            found.delivered++;
            last = values.tick;
        } else if (accepted) {
            found.wrong++;
        }
    }
    free(stream);
    return found;
}
