// SPDX-License-Identifier: Apache-2.0
//! Types of fields, and the entries of a field table.

use core::ffi::{c_char, CStr};

use crate::abi::{Field, NONE};

mod sealed {
    pub trait Sealed {}
}

/// The type of a field: `bool`, `i32`, `i64`, `u32`, `u64`, `f32`, `f64`, and arrays `[T; N]` and `[[T; M]; N]` of
/// these. All bytes 0 is a value of each: the simulator makes instances of zeros.
#[diagnostic::on_unimplemented(
    message = "a field is bool, i32, i64, u32, u64, f32 or f64, or an array of these, not `{Self}`"
)]
pub trait Value: sealed::Sealed {
    #[doc(hidden)]
    const TYPE: u8;
    #[doc(hidden)]
    const SHAPE: &'static [u32];
    #[doc(hidden)]
    const COUNT: u32;
}

/// Types of which `Continuous` is made.
#[diagnostic::on_unimplemented(message = "a continuous state is f64 or an array of it, not `{Self}`")]
pub trait Float64: Value {}

/// Elements of an array.
pub trait Scalar: Value {}

macro_rules! scalars {
    ($($type:ty = $number:literal),*) => {$(
        impl sealed::Sealed for $type {}
        impl Scalar for $type {}
        impl Value for $type {
            const TYPE: u8 = $number;
            const SHAPE: &'static [u32] = &[];
            const COUNT: u32 = 1;
        }
    )*};
}
scalars!(bool = 0, i32 = 1, i64 = 2, u32 = 3, u64 = 4, f32 = 5, f64 = 6);

impl<T: Scalar, const N: usize> sealed::Sealed for [T; N] {}
impl<T: Scalar, const N: usize> Value for [T; N] {
    const TYPE: u8 = T::TYPE;
    const SHAPE: &'static [u32] = &[N as u32];
    const COUNT: u32 = N as u32;
}

impl<T: Scalar, const N: usize, const M: usize> sealed::Sealed for [[T; M]; N] {}
impl<T: Scalar, const N: usize, const M: usize> Value for [[T; M]; N] {
    const TYPE: u8 = T::TYPE;
    const SHAPE: &'static [u32] = &[N as u32, M as u32];
    const COUNT: u32 = (N * M) as u32;
}

impl Float64 for f64 {}
impl<const N: usize> Float64 for [f64; N] {}
impl<const N: usize, const M: usize> Float64 for [[f64; M]; N] {}

/// Stops the compilation where a continuous state is not of `f64`.
pub const fn is_float64<T: Float64>() {}

/// The entry of one field.
pub const fn field<T: Value>(
    path: &'static CStr,
    role: u8,
    flags: u8,
    offset: usize,
    unit: &'static CStr,
    doc: &'static CStr,
) -> Field {
    Field {
        path: path.as_ptr(),
        role,
        type_: T::TYPE,
        flags,
        rank: T::SHAPE.len() as u8,
        shape: if T::SHAPE.is_empty() { core::ptr::null() } else { T::SHAPE.as_ptr() },
        count: T::COUNT,
        offset: offset as u32,
        size: size_of::<T>() as u32,
        instance: NONE,
        connected_from: NONE,
        unit: unit.as_ptr(),
        doc: trimmed(doc),
        minimum: f64::NEG_INFINITY,
        maximum: f64::INFINITY,
    }
}

/// The text of a `///` comment, which begins with a blank.
pub const fn trimmed(doc: &'static CStr) -> *const c_char {
    let text = doc.to_bytes_with_nul();
    match text {
        [b' ', rest @ ..] => rest.as_ptr().cast(),
        _ => text.as_ptr().cast(),
    }
}

/// A C string of a literal that ends with a null character.
pub const fn c_string(text: &'static str) -> &'static CStr {
    match CStr::from_bytes_with_nul(text.as_bytes()) {
        Ok(string) => string,
        Err(_) => panic!("a name, a unit or a comment has a null character in it"),
    }
}
