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

/* Pins and ADC channels are numbered from 0 on; others do not exist. Any address is a register; at most this many of them
 * hold another value than 0 at a time. */
#define FCSL_HW_SIM_COUNT 1024

typedef struct {
    uint32_t address;
    uint32_t value;
} fcsl_hw_sim_register_t;

/* Two that hold the same are equal byte for byte. */
typedef struct fcsl_hw_sim {
    bool gpio[FCSL_HW_SIM_COUNT];    /* the level of a pin: what drove it last, the test or the machine */
    uint32_t adc[FCSL_HW_SIM_COUNT]; /* counts */
    /* Those that are not 0, in rising order of address; behind them zeros. For the two functions below. */
    fcsl_hw_sim_register_t registers[FCSL_HW_SIM_COUNT];
    uint32_t register_count;
} fcsl_hw_sim_t;

/* What a register holds: what the test or the machine wrote last, 0 before. */
uint32_t fcsl_hw_sim_register(const fcsl_hw_sim_t *sim, uint32_t address);
/* Returns 0, or -1 where FCSL_HW_SIM_COUNT others hold a value already. */
int32_t fcsl_hw_sim_set_register(fcsl_hw_sim_t *sim, uint32_t address, uint32_t value);

/* Whether these bytes, from a file, are one: pins are 0 or 1, and registers are in order. */
int fcsl_hw_sim_is_valid(const fcsl_hw_sim_t *sim);

/* The table that reaches `sim`, which must outlive it. */
struct fcsl_hw fcsl_hw_simulated(fcsl_hw_sim_t *sim);

#ifdef __cplusplus
}
#endif

#endif /* FCSL_HW_SIM_H */
