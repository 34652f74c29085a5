/* SPDX-License-Identifier: Apache-2.0
 *
 * What `whole.c` needs of a machine to time: the compiled one, its bodies alone, and the same logic by hand.
 */
#ifndef BENCH_WHOLE_H
#define BENCH_WHOLE_H

#include <fcsl/fcsl_machine.h>

/* Written by main.py beside the machine's own C: every execute body that is due in this tick of the state that is timed,
 * called directly, without pulses, health, schedule of states or arbitration. `whole_bodies` takes the inputs that `past`, the
 * same machine at some tick, had: no body waits for another. `whole_connected` copies what is connected, as the machine does:
 * data flow as in the machine and by hand. */
extern const fcsl_machine_t *const whole_machine;
extern const int32_t whole_state;
void whole_bodies(void *machine, const void *past, uint64_t tick);
void whole_connected(void *machine, const void *past, uint64_t tick);

/* A double (or several) that both have: a sensor, or a result that must agree. */
typedef struct {
    const char *path; /* field of the machine */
    size_t offset; /* in the struct by hand */
    uint32_t count;
    double mean, spread; /* of a sensor; a result has neither */
} whole_link_t;

extern const whole_link_t by_hand_sensors[];
extern const size_t by_hand_sensor_count;
extern const whole_link_t by_hand_results[];
extern const size_t by_hand_result_count;
extern const size_t by_hand_size;
/* Starts in the state that is timed. */
void by_hand_init(void *by_hand);
void by_hand_step(void *by_hand);

#endif /* BENCH_WHOLE_H */
