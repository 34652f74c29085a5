/* SPDX-License-Identifier: Apache-2.0 */
#include "painted.h"

enum { STACK_BYTES = 256 * 1024, ALIGNMENT = 64 };

static const uint8_t PAINT = 0xa5;
static _Alignas(ALIGNMENT) uint8_t stack[STACK_BYTES];

void painted_begin(void)
{
    for (size_t i = 0; i < STACK_BYTES; i++) {
        stack[i] = PAINT;
    }
}

uint64_t painted_call(const void *function, const uint64_t integers[4], const double reals[3])
{
    register double x0 __asm__("xmm0") = reals[0];
    register double x1 __asm__("xmm1") = reals[1];
    register double x2 __asm__("xmm2") = reals[2];
    uint64_t a = integers[0];
    uint64_t b = integers[1];
    uint64_t c = integers[2];
    uint64_t e = integers[3];
    uint64_t result = (uint64_t)(uintptr_t)function;
    /* The callee keeps rbx, which holds our own stack pointer meanwhile. */
    __asm__ volatile("mov %%rsp, %%rbx\n\t"
                     "mov %[top], %%rsp\n\t"
                     "call *%%rax\n\t"
                     "mov %%rbx, %%rsp"
                     : "+a"(result), "+D"(a), "+S"(b), "+d"(c), "+c"(e), "+x"(x0), "+x"(x1), "+x"(x2)
                     : [top] "r"(stack + STACK_BYTES)
                     : "rbx", "r8", "r9", "r10", "r11", "xmm3", "xmm4", "xmm5", "xmm6", "xmm7", "xmm8", "xmm9", "xmm10",
                       "xmm11", "xmm12", "xmm13", "xmm14", "xmm15", "memory", "cc");
    return result;
}

size_t painted_used(void)
{
    size_t untouched = 0;
    while (untouched < STACK_BYTES && stack[untouched] == PAINT) {
        untouched++;
    }
    return untouched == 0 ? SIZE_MAX : STACK_BYTES - untouched;
}
