/* SPDX-License-Identifier: Apache-2.0
 *
 * Simulated hardware: what the builtins hw_* of an algorithm reach where there is no board. Reads give what a test has put
 * into this struct, writes are found in it.
 */
#ifndef FCSL_HW_SIM_H
#define FCSL_HW_SIM_H

#include "fcsl/fcsl_hw.h"

#ifdef __cplusplus
extern "C" {
#endif

/* Pins and channels are numbered from 0 on; others do not exist. */
#define FCSL_HW_SIM_COUNT 1024

typedef struct fcsl_hw_sim {
    bool gpio[FCSL_HW_SIM_COUNT];       /* the level of a pin: what drove it last, the test or the machine */
    double adc[FCSL_HW_SIM_COUNT];      /* V */
    double pwm[FCSL_HW_SIM_COUNT];      /* duty; one outside 0 to 1 is refused and not found here */
    int64_t counter[FCSL_HW_SIM_COUNT];
} fcsl_hw_sim_t;

/* The table that reaches `sim`, which must outlive it. */
struct fcsl_hw fcsl_hw_simulated(fcsl_hw_sim_t *sim);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HW_SIM_H */
