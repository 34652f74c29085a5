/* SPDX-License-Identifier: Apache-2.0
 *
 * The world around a machine as EVA sees it: sources of any value, and a host whose every function may answer anything.
 * A volatile object of EVA holds any bits of its type at each read, NaN and infinities included.
 */
#ifndef EVA_WORLD_H
#define EVA_WORLD_H

#include <stdbool.h>
#include <stdint.h>

#include <fcsl/fcsl_hw.h>

extern volatile double eva_any_f64;
extern volatile float eva_any_f32;
extern volatile int64_t eva_any_i64;
extern volatile int32_t eva_any_i32;
extern volatile uint64_t eva_any_u64;
extern volatile uint32_t eva_any_u32;
extern volatile uint8_t eva_any_u8;

static inline bool eva_any_bool(void)
{
    return eva_any_u8 % 2u == 1u;
}

/* Any enumerator of [0, count). */
static inline int32_t eva_any_below(uint32_t count)
{
    return (int32_t)(eva_any_u32 % count);
}

/* A host with or without a clock, a hardware table, any function of that table, and a replay that substitutes. */
void eva_any_host(fcsl_host_t *host, struct fcsl_hw *hw, int32_t (*substitute)(void *ctx, uint32_t instance));

#endif /* EVA_WORLD_H */
