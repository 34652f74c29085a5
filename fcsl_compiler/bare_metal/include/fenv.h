/* SPDX-License-Identifier: Apache-2.0
 *
 * Of the C standard's <fenv.h>, what generated code and CORE-MATH use; see ../runtime.c.
 */
#ifndef FCSL_BARE_METAL_FENV_H
#define FCSL_BARE_METAL_FENV_H

#define FE_TONEAREST  0
#define FE_UPWARD     1
#define FE_DOWNWARD   2
#define FE_TOWARDZERO 3
#define FE_INVALID    1
#define FE_DIVBYZERO  2
#define FE_OVERFLOW   4
#define FE_UNDERFLOW  8
#define FE_INEXACT    16
#define FE_ALL_EXCEPT 31

typedef int fexcept_t;
typedef int fenv_t;

int fegetround(void);
int feraiseexcept(int flags);
int feclearexcept(int flags);
int fetestexcept(int flags);
int fegetexceptflag(fexcept_t *kept, int flags);
int fesetexceptflag(const fexcept_t *kept, int flags);
int feholdexcept(fenv_t *kept);
int feupdateenv(const fenv_t *kept);

#endif
