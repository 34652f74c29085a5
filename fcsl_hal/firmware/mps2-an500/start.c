/* SPDX-License-Identifier: Apache-2.0
 *
 * Start-up of a bare Cortex-M7, and the three services of a debugger or emulator (semihosting) that the programs here use:
 * their arguments, a line of text, their end.
 */
#include <stdint.h>

#include "pil_board.h"

extern uint32_t data_in_rom[], data_begin[], data_end[], bss_begin[], bss_end[], stack_top[];

enum { WRITE_TEXT = 0x04, GET_ARGUMENTS = 0x15, EXIT = 0x20, EXITED = 0x20026, ARGUMENTS_MAX = 16, LINE_MAX = 512 };

static int semihosting(int operation, const void *argument)
{
    register int r0 __asm__("r0") = operation;
    register const void *r1 __asm__("r1") = argument;
    __asm__ volatile("bkpt 0xab" : "+r"(r0) : "r"(r1) : "memory");
    return r0;
}

void board_print(const char *text)
{
    (void)semihosting(WRITE_TEXT, text);
}

static _Noreturn void leave(int status)
{
    const uint32_t block[2] = {EXITED, (uint32_t)status};
    for (;;) {
        (void)semihosting(EXIT, block);
    }
}

/* The words of the command line, separated by single spaces. */
static int arguments(char **words)
{
    static char line[LINE_MAX];
    uint32_t block[2] = {(uint32_t)(uintptr_t)line, sizeof line - 1u};
    int count = 0;
    if (semihosting(GET_ARGUMENTS, block) != 0) {
        return 0;
    }
    for (uint32_t i = 0; line[i] != '\0' && count < ARGUMENTS_MAX; i++) {
        if (i == 0 || line[i - 1u] == '\0') {
            words[count] = &line[i];
            count++;
        }
        if (line[i] == ' ') {
            line[i] = '\0';
        }
    }
    return count;
}

static void fault(void)
{
    board_print("the processor faulted\n");
    leave(99);
}

/* Memory is set up word by word: there is no C library below this. */
static void prepare_memory(void)
{
    const uint32_t *from = data_in_rom;
    for (uint32_t *to = data_begin; to < data_end; to++, from++) {
        *(volatile uint32_t *)to = *from;
    }
    for (uint32_t *to = bss_begin; to < bss_end; to++) {
        *(volatile uint32_t *)to = 0;
    }
}

_Noreturn void reset(void);
_Noreturn void reset(void)
{
    volatile uint32_t *const coprocessor_access = (volatile uint32_t *)0xe000ed88u;
    *coprocessor_access |= 0xfu << 20; /* the floating-point unit, which reset leaves off */
    __asm__ volatile("dsb\n isb");
    prepare_memory();
    char *words[ARGUMENTS_MAX] = {0};
    const int count = arguments(words);
    leave(main(count, words));
}

/* The initial stack pointer, reset, and the system exceptions; no interrupt is used. */
__attribute__((section(".vectors"), used)) static const void *const vectors[16] = {
    stack_top, reset, fault, fault, fault, fault, fault, 0, 0, 0, 0, fault, fault, 0, fault, fault};
