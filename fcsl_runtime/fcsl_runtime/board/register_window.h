/* SPDX-License-Identifier: Apache-2.0
 *
 * A part of a file in memory, whose words are registers: a UIO device, a resource of PCI, /dev/mem. Reading and writing wait for nothing
 * but the bus.
 */
#ifndef BOARD_REGISTER_WINDOW_H
#define BOARD_REGISTER_WINDOW_H

#include "board_plan.h"

typedef struct {
    const board_registers_t *plan;
    void *mapped; /* whole pages; null: not open */
    size_t mapped_bytes;
    volatile uint32_t *words;
} register_window_t;

/* 0, or -1. */
int register_window_open(register_window_t *window, const board_registers_t *plan, fcsl_error_t *error);
/* The register at this address, or null: it is none of the window's. */
volatile uint32_t *register_window_at(const register_window_t *window, uint32_t address);
void register_window_close(register_window_t *window);

#endif /* BOARD_REGISTER_WINDOW_H */
