// SPDX-License-Identifier: Apache-2.0
//! Elementary functions: those of fcsl_math, correctly rounded, and the exact ones of the C library. They have the same
//! bits on every machine.

/// `use fcsl_model::Math;` makes these functions methods of `f64` and `f32`.
pub trait Math: Copy {
    fn sin(self) -> Self;
    fn cos(self) -> Self;
    fn tan(self) -> Self;
    fn asin(self) -> Self;
    fn acos(self) -> Self;
    fn atan(self) -> Self;
    /// The angle of the point (`x`, `self`).
    fn atan2(self, x: Self) -> Self;
    fn sinh(self) -> Self;
    fn cosh(self) -> Self;
    fn tanh(self) -> Self;
    fn exp(self) -> Self;
    /// exp(self) - 1
    fn exp_m1(self) -> Self;
    /// The natural logarithm.
    fn ln(self) -> Self;
    /// ln(1 + self)
    fn ln_1p(self) -> Self;
    fn log2(self) -> Self;
    fn log10(self) -> Self;
    fn pow(self, exponent: Self) -> Self;
    fn cbrt(self) -> Self;
    fn hypot(self, other: Self) -> Self;
    fn sqrt(self) -> Self;
    fn floor(self) -> Self;
    fn ceil(self) -> Self;
    fn trunc(self) -> Self;
    /// To the nearest integer; half away from zero.
    fn round(self) -> Self;
    /// self * factor + term, rounded once.
    fn mul_add(self, factor: Self, term: Self) -> Self;
}

macro_rules! math {
    ($float:ty: $($method:ident = $function:ident($($argument:ident),*);)*) => {
        const _: () = {
            extern "C" {
                $(fn $function(x: $float, $($argument: $float),*) -> $float;)*
            }
            impl Math for $float {
                $(
                    #[inline]
                    fn $method(self, $($argument: $float),*) -> $float {
                        // SAFETY: a pure function of numbers.
                        unsafe { $function(self, $($argument),*) }
                    }
                )*
            }
        };
    };
}

math!(f64: sin = cr_sin(); cos = cr_cos(); tan = cr_tan(); asin = cr_asin(); acos = cr_acos(); atan = cr_atan();
    atan2 = cr_atan2(x2); sinh = cr_sinh(); cosh = cr_cosh(); tanh = cr_tanh(); exp = cr_exp(); exp_m1 = cr_expm1();
    ln = cr_log(); ln_1p = cr_log1p(); log2 = cr_log2(); log10 = cr_log10(); pow = cr_pow(y); cbrt = cr_cbrt();
    hypot = cr_hypot(y); sqrt = sqrt(); floor = floor(); ceil = ceil(); trunc = trunc(); round = round();
    mul_add = fma(y, z););
math!(f32: sin = cr_sinf(); cos = cr_cosf(); tan = cr_tanf(); asin = cr_asinf(); acos = cr_acosf(); atan = cr_atanf();
    atan2 = cr_atan2f(x2); sinh = cr_sinhf(); cosh = cr_coshf(); tanh = cr_tanhf(); exp = cr_expf();
    exp_m1 = cr_expm1f(); ln = cr_logf(); ln_1p = cr_log1pf(); log2 = cr_log2f(); log10 = cr_log10f(); pow = cr_powf(y); cbrt = cr_cbrtf();
    hypot = cr_hypotf(y); sqrt = sqrtf(); floor = floorf(); ceil = ceilf(); trunc = truncf(); round = roundf();
    mul_add = fmaf(y, z););
