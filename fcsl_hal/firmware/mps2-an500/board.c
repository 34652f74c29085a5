/* SPDX-License-Identifier: Apache-2.0
 *
 * QEMU's `mps2-an500`: the first serial port (ARM's CMSDK UART), whose receiver is interrupt 0, and the timer of the processor.
 * Interrupts stay masked: a pending one ends a sleep, and does nothing else.
 */
#include "pil_board.h"

static volatile uint32_t *const UART = (volatile uint32_t *)0x40004000u;
enum { DATA = 0, STATE = 1, CONTROL = 2, PENDING = 3, DIVIDER = 4 };
enum { SEND_FULL = 1, RECEIVED = 2, ENABLE_WITH_INTERRUPT = 1 | 2 | 8, LEAST_DIVIDER = 16 };
static volatile uint32_t *const INTERRUPT_ENABLE = (volatile uint32_t *)0xe000e100u;
static volatile uint32_t *const INTERRUPT_CLEAR = (volatile uint32_t *)0xe000e280u;
static volatile uint32_t *const TIMER = (volatile uint32_t *)0xe000e010u;
static volatile uint32_t *const INTERRUPT_STATE = (volatile uint32_t *)0xe000ed04u;
enum {
    TIMER_CONTROL = 0,
    TIMER_RELOAD = 1,
    TIMER_VALUE = 2,
    TIMER_ON = 7,
    TIMER_PASSED = 1 << 16,
    TIMER_CLEAR = 1 << 25
};
enum { CLOCK_HZ = 25000000, TICK_HZ = 1000 };

void board_open(void)
{
    UART[DIVIDER] = LEAST_DIVIDER;
    UART[CONTROL] = ENABLE_WITH_INTERRUPT;
    TIMER[TIMER_RELOAD] = CLOCK_HZ / TICK_HZ - 1;
    TIMER[TIMER_VALUE] = 0;
    TIMER[TIMER_CONTROL] = TIMER_ON;
    __asm__ volatile("cpsid i");
    *INTERRUPT_ENABLE = 1u;
}

int board_receive(uint8_t *byte)
{
    if ((UART[STATE] & RECEIVED) == 0u) {
        return 0;
    }
    UART[PENDING] = RECEIVED; /* before the byte is taken, and so before the next one can come */
    *INTERRUPT_CLEAR = 1u;
    *byte = (uint8_t)UART[DATA];
    return 1;
}

void board_send(uint8_t byte)
{
    while ((UART[STATE] & SEND_FULL) != 0u) {
    }
    UART[DATA] = byte;
}

int board_tick(void)
{
    if ((TIMER[TIMER_CONTROL] & TIMER_PASSED) == 0u) {
        return 0;
    }
    *INTERRUPT_STATE = TIMER_CLEAR;
    return 1;
}

void board_wait(void)
{
    __asm__ volatile("wfi");
}
