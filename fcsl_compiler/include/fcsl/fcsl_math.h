/* SPDX-License-Identifier: Apache-2.0
 *
 * Correctly rounded elementary functions (CORE-MATH): the result is the real result rounded once, to nearest even, on
 * every machine. They allocate nothing, set no errno and keep no state. Link fcsl_compiler::fcsl_math.
 */
#ifndef FCSL_MATH_H
#define FCSL_MATH_H

#ifdef __cplusplus
extern "C" {
#endif

/* binary64 */
double cr_sin(double x);
double cr_cos(double x);
double cr_tan(double x);
double cr_asin(double x);
double cr_acos(double x);
double cr_atan(double x);
double cr_atan2(double y, double x);
double cr_sinh(double x);
double cr_cosh(double x);
double cr_tanh(double x);
double cr_exp(double x);
double cr_expm1(double x);
double cr_log(double x);
double cr_log1p(double x);
double cr_log2(double x);
double cr_log10(double x);
double cr_pow(double x, double y);
double cr_cbrt(double x);
double cr_hypot(double x, double y);

/* binary32 */
float cr_sinf(float x);
float cr_cosf(float x);
float cr_tanf(float x);
float cr_asinf(float x);
float cr_acosf(float x);
float cr_atanf(float x);
float cr_atan2f(float y, float x);
float cr_sinhf(float x);
float cr_coshf(float x);
float cr_tanhf(float x);
float cr_expf(float x);
float cr_expm1f(float x);
float cr_logf(float x);
float cr_log1pf(float x);
float cr_log2f(float x);
float cr_log10f(float x);
float cr_powf(float x, float y);
float cr_cbrtf(float x);
float cr_hypotf(float x, float y);

#ifdef __cplusplus
}
#endif

#endif
