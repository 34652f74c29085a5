/* SPDX-License-Identifier: Apache-2.0
 *
 * What the builtins hw_* of an algorithm reach: simulated hardware, or a board's table in its place. Every call goes
 * through here, so that failures are counted whoever serves it.
 */
#define _GNU_SOURCE
#include <dlfcn.h>

#include "hardware.h"

#include "fcsl/fcsl_library.h"

/* 0, or -1 after counting a failure. */
static int32_t judge(fcsl_run_t *run, int32_t status)
{
    if (status == 0) {
        return 0;
    }
    run->hardware_failures++;
    return -1;
}

static int32_t read_gpio(void *ctx, uint32_t pin, bool *level)
{
    fcsl_run_t *run = ctx;
    const struct fcsl_hw *served = &run->hardware;
    return judge(run, served->read_gpio != NULL ? served->read_gpio(served->ctx, pin, level) : -1);
}

static int32_t write_gpio(void *ctx, uint32_t pin, bool level)
{
    fcsl_run_t *run = ctx;
    const struct fcsl_hw *served = &run->hardware;
    return judge(run, served->write_gpio != NULL ? served->write_gpio(served->ctx, pin, level) : -1);
}

static int32_t read_adc(void *ctx, uint32_t channel, uint32_t *counts)
{
    fcsl_run_t *run = ctx;
    const struct fcsl_hw *served = &run->hardware;
    return judge(run, served->read_adc != NULL ? served->read_adc(served->ctx, channel, counts) : -1);
}

static int32_t read_u32(void *ctx, uint32_t address, uint32_t *value)
{
    fcsl_run_t *run = ctx;
    const struct fcsl_hw *served = &run->hardware;
    return judge(run, served->read_u32 != NULL ? served->read_u32(served->ctx, address, value) : -1);
}

static int32_t write_u32(void *ctx, uint32_t address, uint32_t value)
{
    fcsl_run_t *run = ctx;
    const struct fcsl_hw *served = &run->hardware;
    return judge(run, served->write_u32 != NULL ? served->write_u32(served->ctx, address, value) : -1);
}

void fcsl_hardware_init(fcsl_run_t *run)
{
    run->hardware = fcsl_hw_simulated(&run->simulated);
    run->counted = (struct fcsl_hw){
        .ctx = run,
        .read_gpio = read_gpio,
        .write_gpio = write_gpio,
        .read_adc = read_adc,
        .read_u32 = read_u32,
        .write_u32 = write_u32,
    };
    run->host.hw = &run->counted;
}

fcsl_hw_sim_t *fcsl_run_simulated_hardware(fcsl_run_t *run)
{
    return &run->simulated;
}

void fcsl_run_use_board(fcsl_run_t *run, const struct fcsl_hw *board)
{
    run->board = board;
    run->hardware = board != NULL ? *board : fcsl_hw_simulated(&run->simulated);
}

int fcsl_run_has_board(const fcsl_run_t *run)
{
    return run->board != NULL;
}

uint64_t fcsl_run_hardware_failures(const fcsl_run_t *run)
{
    return run->hardware_failures;
}

/* A function of the board library: dlsym gives an object pointer, which POSIX lets stand for one. */
static int find(void *library, const char *name, void *function, size_t size)
{
    void *symbol = dlsym(library, name);
    memcpy(function, &symbol, size);
    return symbol != NULL ? 0 : -1;
}

int fcsl_run_open_board(fcsl_run_t *run, const char *library, fcsl_error_t *error)
{
    if (run->board != NULL) {
        return fcsl_fail(
            error, "there is a board already: that of --hal linux:PLAN, whose plan has pins, converters or registers");
    }
    void *handle = fcsl_library_open(library, "board", error);
    if (handle == NULL) {
        return -1;
    }
    fcsl_board_open_fn *open = NULL;
    fcsl_board_close_fn *close = NULL;
    if (find(handle, FCSL_BOARD_OPEN, &open, sizeof open) != 0 ||
        find(handle, FCSL_BOARD_CLOSE, &close, sizeof close) != 0) {
        (void)dlclose(handle);
        return fcsl_fail(error, "'%s' is not a board library: it lacks " FCSL_BOARD_OPEN " or " FCSL_BOARD_CLOSE,
                         library);
    }
    char reason[256] = "";
    const struct fcsl_hw *board = open(reason, sizeof reason);
    if (board == NULL) {
        (void)dlclose(handle);
        reason[sizeof reason - 1u] = '\0';
        return fcsl_fail(error, "board '%s': %s", library, reason[0] != '\0' ? reason : "it cannot be opened");
    }
    run->board_library = handle;
    run->close_board = close;
    fcsl_run_use_board(run, board);
    return 0;
}

void fcsl_hardware_close(fcsl_run_t *run)
{
    if (run->board_library != NULL) {
        run->close_board(run->board);
        fcsl_run_use_board(run, NULL);
        (void)dlclose(run->board_library);
        run->board_library = NULL;
    }
}
