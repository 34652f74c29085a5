// SPDX-License-Identifier: Apache-2.0
//! The structs of `fcsl/fcsl_model.h` and `fcsl/fcsl_machine.h`, with their names in Rust. Names and order of the
//! members are those of C; the comments there say what they mean.

use core::ffi::{c_char, c_void};

pub const MODEL_ABI_VERSION: u32 = 4;
pub const NO_OFFSET: u32 = u32::MAX;
pub const NONE: i32 = -1;

pub const ROLE_INPUT: u8 = 1;
pub const ROLE_OUTPUT: u8 = 2;
pub const ROLE_PARAMETER: u8 = 3;
pub const ROLE_STATE: u8 = 4;
pub const FIELD_FEEDTHROUGH: u8 = 1 << 4;
pub const FIELD_OPTIONAL: u8 = 1 << 5;
pub const FIELD_TABLE: u8 = 1 << 6;

/// fcsl_field_t
#[repr(C)]
pub struct Field {
    pub path: *const c_char,
    pub role: u8,
    pub type_: u8,
    pub flags: u8,
    pub rank: u8,
    pub shape: *const u32,
    pub count: u32,
    pub offset: u32,
    pub size: u32,
    pub instance: i32,
    pub connected_from: i32,
    pub unit: *const c_char,
    pub doc: *const c_char,
    pub minimum: f64,
    pub maximum: f64,
}

/// fcsl_model_context_t
#[repr(C)]
pub struct ModelContext {
    pub time_ns: i64,
    pub noise: *mut c_void,
    pub gaussian: unsafe extern "C" fn(*mut c_void, u32) -> f64,
    pub uniform: unsafe extern "C" fn(*mut c_void, u32) -> f64,
    pub model: *const ModelDescriptor,
}

/// fcsl_model_event_t
#[repr(C)]
pub struct ModelEvent {
    pub name: *const c_char,
    pub crossing: u8,
    pub doc: *const c_char,
}

pub type InitFn = unsafe extern "C" fn(*mut c_void, *const ModelContext) -> *const c_char;
pub type DerivativeFn = unsafe extern "C" fn(*const c_void, f64, *const f64, *mut f64);
pub type OutputFn = unsafe extern "C" fn(*mut c_void, f64, *const f64);
pub type UpdateFn = unsafe extern "C" fn(*mut c_void, *const ModelContext);
pub type EventFn = unsafe extern "C" fn(*const c_void, f64, *const f64, *mut f64);
pub type ResetFn = unsafe extern "C" fn(*mut c_void, *const ModelContext, u32);
pub type NextTimeFn = unsafe extern "C" fn(*const c_void, f64) -> f64;

/// fcsl_model_t
#[repr(C)]
pub struct ModelDescriptor {
    pub abi_version: u32,
    pub name: *const c_char,
    pub doc: *const c_char,
    pub fields: *const Field,
    pub field_count: u32,
    pub size: u32,
    pub align: u32,
    pub continuous_offset: u32,
    pub continuous_count: u32,
    pub is_second_order: u8,
    pub sampled_offset: u32,
    pub events: *const ModelEvent,
    pub event_count: u32,
    pub init: Option<InitFn>,
    pub derivative: Option<DerivativeFn>,
    pub output: Option<OutputFn>,
    pub update: Option<UpdateFn>,
    pub event: Option<EventFn>,
    pub reset: Option<ResetFn>,
    pub next_time: Option<NextTimeFn>,
}

/// A constant table of C structs. Their pointers lead to constants, so any thread may read it.
#[repr(transparent)]
pub struct Table<T, const N: usize>(pub [T; N]);

// SAFETY: nothing writes a table, or what its pointers lead to.
unsafe impl<T, const N: usize> Sync for Table<T, N> {}
