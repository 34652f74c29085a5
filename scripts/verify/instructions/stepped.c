/* SPDX-License-Identifier: Apache-2.0 */
#define _GNU_SOURCE
#include "stepped.h"

#include <errno.h>
#include <signal.h>
#include <string.h>
#include <ucontext.h>

enum { TRAP_FLAG = 0x100 };

stepped_t stepped;

static uintptr_t target;   /* not reached yet, or 0 */
static uintptr_t back;     /* where the call returns to */
static uintptr_t stack;    /* the stack pointer at its first instruction */
static uint8_t left;        /* kind of the OWN or APART instruction that was executed last */

/* Before every instruction: `at` is the one that comes. */
static void on_trap(int number, siginfo_t *info, void *context)
{
    (void)number;
    (void)info;
    greg_t *const registers = ((ucontext_t *)context)->uc_mcontext.gregs;
    const uintptr_t at = (uintptr_t)registers[REG_RIP];
    const uintptr_t top = (uintptr_t)registers[REG_RSP];
    if (target != 0) {
        if (at != target) {
            return;
        }
        target = 0;
        stack = top;
        memcpy(&back, (const void *)top, sizeof back);
    }
    if (at == back && top > stack) {
        registers[REG_EFL] &= ~(greg_t)TRAP_FLAG;
        return;
    }
    const uint8_t kind = at - stepped.begin < STEPPED_MOST_BYTES ? stepped.kinds[at - stepped.begin] : STEPPED_OTHER;
    if (kind != STEPPED_OTHER) {
        left = kind;
        stepped.reached[at - stepped.begin] = 1;
        stepped.own += 1;
        stepped.all += 1;
    } else if (left != STEPPED_APART) {
        stepped.all += 1;
    }
}

int stepped_begin(void)
{
    static uint8_t own_stack[1 << 16];
    const stack_t other = {.ss_sp = own_stack, .ss_size = sizeof own_stack};
    struct sigaction action;
    memset(&action, 0, sizeof action);
    action.sa_sigaction = on_trap;
    action.sa_flags = SA_SIGINFO | SA_ONSTACK;
    return sigaltstack(&other, NULL) == 0 && sigaction(SIGTRAP, &action, NULL) == 0 ? 0 : errno;
}

void stepped_arm(uintptr_t next)
{
    target = next;
    left = STEPPED_OTHER;
    stepped.own = stepped.all = 0;
    __asm__ volatile("pushfq\n\torq %0, (%%rsp)\n\tpopfq" ::"i"(TRAP_FLAG) : "memory", "cc");
}
