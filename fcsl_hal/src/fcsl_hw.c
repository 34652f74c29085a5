/* SPDX-License-Identifier: Apache-2.0 */
#include "fcsl/fcsl_hw_sim.h"

static int exists(int32_t number)
{
    return number >= 0 && number < FCSL_HW_SIM_COUNT;
}

static int32_t read_gpio(void *ctx, int32_t pin, bool *level)
{
    const fcsl_hw_sim_t *sim = ctx;
    if (!exists(pin)) {
        return -1;
    }
    *level = sim->gpio[pin];
    return 0;
}

static int32_t write_gpio(void *ctx, int32_t pin, bool level)
{
    fcsl_hw_sim_t *sim = ctx;
    if (!exists(pin)) {
        return -1;
    }
    sim->gpio[pin] = level;
    return 0;
}

static int32_t read_adc(void *ctx, int32_t channel, double *volts)
{
    const fcsl_hw_sim_t *sim = ctx;
    if (!exists(channel)) {
        return -1;
    }
    *volts = sim->adc[channel];
    return 0;
}

static int32_t write_pwm(void *ctx, int32_t channel, double duty)
{
    fcsl_hw_sim_t *sim = ctx;
    if (!exists(channel) || !(duty >= 0.0 && duty <= 1.0)) {
        return -1;
    }
    sim->pwm[channel] = duty;
    return 0;
}

static int32_t read_counter(void *ctx, int32_t channel, int64_t *count)
{
    const fcsl_hw_sim_t *sim = ctx;
    if (!exists(channel)) {
        return -1;
    }
    *count = sim->counter[channel];
    return 0;
}

struct fcsl_hw fcsl_hw_simulated(fcsl_hw_sim_t *sim)
{
    const struct fcsl_hw hw = {
        .ctx = sim,
        .read_gpio = read_gpio,
        .write_gpio = write_gpio,
        .read_adc = read_adc,
        .write_pwm = write_pwm,
        .read_counter = read_counter,
    };
    return hw;
}
