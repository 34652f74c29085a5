/* SPDX-License-Identifier: Apache-2.0
 *
 * Messages of FCSL beside MAVLink 2, the same values in each:
 *   wire ROUNDS NOISY CORRUPTED
 * Sizes; ns to encode and to decode, the rounds of the formats in turns; of NOISY messages how many arrive when bits of the
 * stream flip; of CORRUPTED frames how many are accepted. Prints JSON.
 */
#include "corrupted.h"
#include "flipped_bits.h"
#include "timing.h"
#include "values.h"

#include <stdio.h>
#include <stdlib.h>

enum { BATCH = 500, FORMATS = 4 };

static const format_t *const FORMAT[FORMATS] = {&FCSL_MESSAGE, &FCSL_SERIAL, &MAVLINK_OWN, &MAVLINK_STANDARD};
static const char *const DIRECTION[DIRECTIONS] = {"sensors", "actuators"};

typedef struct {
    double encode_ns, decode_ns; /* of the best round */
    size_t bytes;
} times_t;

/* One batch there and back, which must be the same values again. */
static void turn(const format_t *format, direction_t direction, times_t *best)
{
    static uint8_t bytes[BATCH][MESSAGE_MAX];
    static size_t sizes[BATCH];
    static values_t values[BATCH];
    static values_t decoded[BATCH];
    int accepted = 0;
    for (uint64_t i = 0; i < BATCH; i++) {
        values[i] = values_of(FIRST_TICK + i);
    }
    format->reset();
    const double begun = now_ns();
    for (int i = 0; i < BATCH; i++) {
        sizes[i] = format->encode(direction, &values[i], bytes[i]);
    }
    const double encoded = now_ns();
    for (int i = 0; i < BATCH; i++) {
        int one = 0;
        (void)format->decode(direction, bytes[i], sizes[i], &decoded[i], &one);
        accepted += one;
    }
    const double ended = now_ns();
    for (int i = 0; i < BATCH; i++) {
        accepted -= equal_values(direction, &values[i], &decoded[i]);
    }
    if (accepted != 0) {
        fprintf(stderr, "wire: %s does not carry the values\n", format->name);
        exit(1);
    }
    best->bytes = sizes[0];
    best->encode_ns = (encoded - begun) / BATCH < best->encode_ns ? (encoded - begun) / BATCH : best->encode_ns;
    best->decode_ns = (ended - encoded) / BATCH < best->decode_ns ? (ended - encoded) / BATCH : best->decode_ns;
}

static void print_times(int rounds)
{
    times_t best[DIRECTIONS][FORMATS];
    for (int i = 0; i < DIRECTIONS * FORMATS; i++) {
        best[i / FORMATS][i % FORMATS] = (times_t){.encode_ns = 1e12, .decode_ns = 1e12};
    }
    for (int r = 0; r < rounds; r++) {
        for (int i = 0; i < DIRECTIONS * FORMATS; i++) {
            turn(FORMAT[i % FORMATS], (direction_t)(i / FORMATS), &best[i / FORMATS][i % FORMATS]);
        }
    }
    for (int d = 0; d < DIRECTIONS; d++) {
        printf("%s\"%s\": {", d > 0 ? ", " : "", DIRECTION[d]);
        for (int f = 0; f < FORMATS; f++) {
            const times_t *found = &best[d][f];
            printf("%s\"%s\": {\"bytes\": %zu, \"encode_ns\": %.1f, \"decode_ns\": %.1f}", f > 0 ? ", " : "",
                   FORMAT[f]->name, found->bytes, found->encode_ns, found->decode_ns);
        }
        printf("}");
    }
}

static void print_flipped(long messages)
{
    static const double RATES[] = {0.0001, 0.001, 0.01};
    for (int r = 0; r < 3; r++) {
        printf("%s\"%g\": {", r > 0 ? ", " : "", RATES[r]);
        for (int f = 1; f < FORMATS; f++) { /* a message alone has no beginning that is found again */
            const flipped_t found = under_flipped_bits(FORMAT[f], messages, RATES[r]);
            printf("%s\"%s\": {\"delivered\": %.5f, \"wrong\": %ld}", f > 1 ? ", " : "", FORMAT[f]->name,
                   (double)found.delivered / (double)messages, found.wrong);
        }
        printf("}");
    }
}

int main(int argc, char **argv)
{
    if (argc != 4) {
        fprintf(stderr, "usage: wire ROUNDS NOISY CORRUPTED\n");
        return 2;
    }
    const long frames = atol(argv[3]);
    printf("{\"times\": {");
    print_times(atoi(argv[1]));
    printf("}, \"messages\": %ld, \"flipped\": {", atol(argv[2]));
    print_flipped(atol(argv[2]));
    const corrupted_t found = under_corruption(frames);
    printf(
        "}, \"corrupted\": {\"frames\": %ld, \"link_crc16\": %ld, \"message_crc32\": %ld, \"link_and_message\": %ld, "
        "\"mavlink\": %ld}}\n",
        frames, found.link, found.message, found.both, found.mavlink);
    return 0;
}
