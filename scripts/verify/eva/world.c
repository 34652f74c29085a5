/* SPDX-License-Identifier: Apache-2.0 */
#include "world.h"

volatile double eva_any_f64;
volatile float eva_any_f32;
volatile int64_t eva_any_i64;
volatile int32_t eva_any_i32;
volatile uint64_t eva_any_u64;
volatile uint32_t eva_any_u32;
volatile uint8_t eva_any_u8;

static uint64_t any_clock(void *ctx)
{
    (void)ctx;
    return eva_any_u64;
}

/* A function of the table may fail, and may store a value or none before it does. */

static int32_t any_read_gpio(void *ctx, uint32_t pin, bool *level)
{
    (void)ctx;
    (void)pin;
    if (eva_any_bool()) {
        *level = eva_any_bool();
    }
    return eva_any_i32;
}

static int32_t any_write_gpio(void *ctx, uint32_t pin, bool level)
{
    (void)ctx;
    (void)pin;
    (void)level;
    return eva_any_i32;
}

static int32_t any_read_adc(void *ctx, uint32_t channel, uint32_t *counts)
{
    (void)ctx;
    (void)channel;
    if (eva_any_bool()) {
        *counts = eva_any_u32;
    }
    return eva_any_i32;
}

static int32_t any_read_u32(void *ctx, uint32_t address, uint32_t *value)
{
    (void)ctx;
    (void)address;
    if (eva_any_bool()) {
        *value = eva_any_u32;
    }
    return eva_any_i32;
}

static int32_t any_write_u32(void *ctx, uint32_t address, uint32_t value)
{
    (void)ctx;
    (void)address;
    (void)value;
    return eva_any_i32;
}

static void any_executed(void *ctx, uint32_t instance)
{
    (void)ctx;
    (void)instance;
}

void eva_any_host(fcsl_host_t *host, struct fcsl_hw *hw, int32_t (*substitute)(void *ctx, uint32_t instance))
{
    hw->ctx = NULL;
    hw->read_gpio = eva_any_bool() ? any_read_gpio : NULL;
    hw->write_gpio = eva_any_bool() ? any_write_gpio : NULL;
    hw->read_adc = eva_any_bool() ? any_read_adc : NULL;
    hw->read_u32 = eva_any_bool() ? any_read_u32 : NULL;
    hw->write_u32 = eva_any_bool() ? any_write_u32 : NULL;
    host->ctx = NULL;
    host->clock_ns = eva_any_bool() ? any_clock : NULL;
    host->hw = eva_any_bool() ? hw : NULL;
    host->substitute = eva_any_bool() ? substitute : NULL;
    host->executed = eva_any_bool() ? any_executed : NULL;
}
