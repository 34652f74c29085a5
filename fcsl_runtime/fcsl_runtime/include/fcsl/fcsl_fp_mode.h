/* SPDX-License-Identifier: Apache-2.0
 *
 * The floating-point mode of the calling thread: rounding, and whether small numbers become zero. Bits depend on it, and any
 * library of the process can change it: one that was linked with -ffast-math does so when it is loaded. So whoever computes sets
 * the mode of IEEE 754 first, and gives the caller's back.
 */
#ifndef FCSL_FP_MODE_H
#define FCSL_FP_MODE_H

#include <stdint.h>

#if defined(__SSE2__)
#include <xmmintrin.h>

/* MXCSR: rounding, masks of exceptions, flush to zero, denormals are zero; below them the flags, which belong to the caller. */
#define FCSL_FP_CONTROL UINT32_C(0xffc0)
#define FCSL_FP_DEFAULT UINT32_C(0x1f80) /* to nearest, all exceptions masked */
typedef uint32_t fcsl_fp_mode_t;

static inline fcsl_fp_mode_t fcsl_fp_mode(void)
{
    return (uint32_t)_mm_getcsr() & FCSL_FP_CONTROL;
}

static inline void fcsl_fp_set(fcsl_fp_mode_t mode)
{
    _mm_setcsr(((uint32_t)_mm_getcsr() & ~FCSL_FP_CONTROL) | mode);
}

#elif defined(__aarch64__)

/* FPCR: AHP, DN, FZ, RMode, FZ16 and the traps. */
#define FCSL_FP_CONTROL UINT64_C(0x07c89f00)
#define FCSL_FP_DEFAULT UINT64_C(0)
typedef uint64_t fcsl_fp_mode_t;

static inline uint64_t fcsl_fp_register(void)
{
    uint64_t bits;
    __asm__ volatile("mrs %0, fpcr" : "=r"(bits));
    return bits;
}

static inline fcsl_fp_mode_t fcsl_fp_mode(void)
{
    return fcsl_fp_register() & FCSL_FP_CONTROL;
}

static inline void fcsl_fp_set(fcsl_fp_mode_t mode)
{
    const uint64_t bits = (fcsl_fp_register() & ~FCSL_FP_CONTROL) | mode;
    __asm__ volatile("msr fpcr, %0" : : "r"(bits));
}

#else /* what C11 knows of it */
#include <fenv.h>

#define FCSL_FP_DEFAULT FE_TONEAREST
typedef int fcsl_fp_mode_t;

static inline fcsl_fp_mode_t fcsl_fp_mode(void)
{
    return fegetround();
}

static inline void fcsl_fp_set(fcsl_fp_mode_t mode)
{
    (void)fesetround(mode); /* a mode that fegetround returned, or the default */
}
#endif

/* Sets the mode of IEEE 754, and returns the caller's. */
static inline fcsl_fp_mode_t fcsl_fp_enter(void)
{
    const fcsl_fp_mode_t callers = fcsl_fp_mode();
    if (callers != FCSL_FP_DEFAULT) {
        fcsl_fp_set(FCSL_FP_DEFAULT);
    }
    return callers;
}

static inline void fcsl_fp_leave(fcsl_fp_mode_t callers)
{
    if (callers != FCSL_FP_DEFAULT) {
        fcsl_fp_set(callers);
    }
}

#endif /* FCSL_FP_MODE_H */
