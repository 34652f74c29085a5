/* SPDX-License-Identifier: Apache-2.0
 *
 * The contract under which EVA meets the math library: for any arguments, NaN and infinities included, a function returns
 * some value of its type, which depends on its arguments alone, and touches nothing else. Nothing is said of which value:
 * the less is assumed here, the more is proven. Stands in place of Frama-C's own <math.h>, which wants finite arguments.
 */
#ifndef EVA_MATH_H
#define EVA_MATH_H
#define __FC_MATH /* Frama-C's <math.h> is then empty */

#define INFINITY (1.0f / 0.0f)
#define NAN      (0.0f / 0.0f)

/* Of the system: exact functions only. */
/*@ assigns \result \from x; */
double sqrt(double x);
/*@ assigns \result \from x; */
float sqrtf(float x);
/*@ assigns \result \from x; */
double fabs(double x);
/*@ assigns \result \from x; */
float fabsf(float x);
/*@ assigns \result \from x; */
double floor(double x);
/*@ assigns \result \from x; */
float floorf(float x);
/*@ assigns \result \from x; */
double ceil(double x);
/*@ assigns \result \from x; */
float ceilf(float x);
/*@ assigns \result \from x; */
double trunc(double x);
/*@ assigns \result \from x; */
float truncf(float x);
/*@ assigns \result \from x; */
double round(double x);
/*@ assigns \result \from x; */
float roundf(float x);
/*@ assigns \result \from x, y; */
double fmod(double x, double y);
/*@ assigns \result \from x, y; */
float fmodf(float x, float y);
/*@ assigns \result \from x, y; */
double copysign(double x, double y);
/*@ assigns \result \from x, y; */
float copysignf(float x, float y);

/* fcsl_math.h declares these once more; EVA joins contracts and declarations. */
/*@ assigns \result \from x; */
double cr_sin(double x);
/*@ assigns \result \from x; */
float cr_sinf(float x);
/*@ assigns \result \from x; */
double cr_cos(double x);
/*@ assigns \result \from x; */
float cr_cosf(float x);
/*@ assigns \result \from x; */
double cr_tan(double x);
/*@ assigns \result \from x; */
float cr_tanf(float x);
/*@ assigns \result \from x; */
double cr_asin(double x);
/*@ assigns \result \from x; */
float cr_asinf(float x);
/*@ assigns \result \from x; */
double cr_acos(double x);
/*@ assigns \result \from x; */
float cr_acosf(float x);
/*@ assigns \result \from x; */
double cr_atan(double x);
/*@ assigns \result \from x; */
float cr_atanf(float x);
/*@ assigns \result \from x; */
double cr_sinh(double x);
/*@ assigns \result \from x; */
float cr_sinhf(float x);
/*@ assigns \result \from x; */
double cr_cosh(double x);
/*@ assigns \result \from x; */
float cr_coshf(float x);
/*@ assigns \result \from x; */
double cr_tanh(double x);
/*@ assigns \result \from x; */
float cr_tanhf(float x);
/*@ assigns \result \from x; */
double cr_exp(double x);
/*@ assigns \result \from x; */
float cr_expf(float x);
/*@ assigns \result \from x; */
double cr_expm1(double x);
/*@ assigns \result \from x; */
float cr_expm1f(float x);
/*@ assigns \result \from x; */
double cr_log(double x);
/*@ assigns \result \from x; */
float cr_logf(float x);
/*@ assigns \result \from x; */
double cr_log1p(double x);
/*@ assigns \result \from x; */
float cr_log1pf(float x);
/*@ assigns \result \from x; */
double cr_log2(double x);
/*@ assigns \result \from x; */
float cr_log2f(float x);
/*@ assigns \result \from x; */
double cr_log10(double x);
/*@ assigns \result \from x; */
float cr_log10f(float x);
/*@ assigns \result \from x; */
double cr_cbrt(double x);
/*@ assigns \result \from x; */
float cr_cbrtf(float x);
/*@ assigns \result \from x, y; */
double cr_atan2(double x, double y);
/*@ assigns \result \from x, y; */
float cr_atan2f(float x, float y);
/*@ assigns \result \from x, y; */
double cr_pow(double x, double y);
/*@ assigns \result \from x, y; */
float cr_powf(float x, float y);
/*@ assigns \result \from x, y; */
double cr_hypot(double x, double y);
/*@ assigns \result \from x, y; */
float cr_hypotf(float x, float y);

#endif /* EVA_MATH_H */
