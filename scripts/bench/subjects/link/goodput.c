/* SPDX-License-Identifier: Apache-2.0
 *
 * How much a reliable port carries over a line that loses frames: one frame leaves at every link tick, and arrives DELAY link
 * ticks later, if it is not lost. Prints JSON: frames of payload delivered per link tick, the share of the line that they are.
 *
 *   goodput LOSS TICKS SEED        LOSS: of frames to the receiver, 0 to 1; acknowledgements are not lost
 */
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "fcsl/fcsl_link.h"
#include "timing.h"

enum { DELAY = 4, RETRANSMIT_TICKS = 2 * DELAY + 2, PORT = 0, ENDS = 2 };

typedef struct {
    uint8_t frame[FCSL_LINK_FRAME_MAX];
    size_t size;
} flight_t;

static uint64_t random_state;

/* [0, 1); splitmix64. */
static double uniform(void)
{
    uint64_t z = random_state += UINT64_C(0x9E3779B97F4A7C15);
    z = (z ^ z >> 30) * UINT64_C(0xBF58476D1CE4E5B9);
    z = (z ^ z >> 27) * UINT64_C(0x94D049BB133111EB);
    return (double)((z ^ z >> 31) >> 11) * 0x1p-53;
}

int main(int argc, char **argv)
{
    static flight_t line[ENDS][DELAY];
    static uint8_t message[FCSL_LINK_PAYLOAD_MAX];
    const fcsl_link_policy_t policies[FCSL_LINK_PORTS] = {[PORT] = FCSL_LINK_RELIABLE};
    if (argc != 4) {
        return 2;
    }
    fcsl_link_t *ends = allocate(ENDS * sizeof *ends);
    const double loss = atof(argv[1]);
    const long ticks = atol(argv[2]);
    random_state = strtoull(argv[3], NULL, 10);
    uint64_t delivered = 0;
    for (int i = 0; i < ENDS; i++) {
        if (fcsl_link_open(&ends[i], policies, (uint16_t)(i + 1), RETRANSMIT_TICKS) != 0) {
            return 1;
        }
    }
    for (long tick = 0; tick < ticks; tick++) {
        while (fcsl_link_send(&ends[0], PORT, message, sizeof message) == FCSL_LINK_OK) {
        }
        for (int i = 0; i < ENDS; i++) {
            flight_t *slot = &line[i][tick % DELAY];
            if (slot->size > 0) {
                fcsl_link_take_frame(&ends[1 - i], slot->frame, slot->size);
            }
            fcsl_link_tick(&ends[i]);
            slot->size = fcsl_link_next_frame(&ends[i], slot->frame);
            if (i == 0 && fcsl_link_connected(&ends[0]) && uniform() < loss) {
                slot->size = 0;
            }
        }
        size_t size = 0;
        while (fcsl_link_receive(&ends[1], PORT, message, sizeof message, &size) == FCSL_LINK_OK) {
            delivered++;
        }
    }
    const fcsl_link_port_counters_t *port = &ends[0].ports[PORT].counters;
    (void)printf("{\"goodput\": %.5f, \"repeated\": %" PRIu64 ", \"round_trip\": %d, \"timeout\": %d}\n",
                 (double)delivered / (double)ticks, port->frames_repeated, 2 * DELAY - 1, RETRANSMIT_TICKS);
    free(ends);
    return 0;
}
