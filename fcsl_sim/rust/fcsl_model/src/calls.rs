// SPDX-License-Identifier: Apache-2.0
//! The functions of the descriptor: each makes references of the simulator's pointers and calls the model.
//!
//! The references of one call never overlap: they lead to different members of the instance, and `x` and `dx` are
//! memory of the simulator.

use core::ffi::{c_char, c_void};
use core::marker::PhantomData;
use core::ptr::NonNull;

use crate::abi::{DerivativeFn, EventFn, InitFn, ModelContext, NextTimeFn, OutputFn, ResetFn, UpdateFn};
use crate::{Context, Derivative, Event, Init, Instance, Instant, Model, NextTime, Output, Reset, Update};

/// A model without continuous states gets a null pointer, and its `Continuous` has no member.
unsafe fn states<'a, M: Model>(x: *const f64) -> &'a M::Continuous {
    let at =
        if size_of::<M::Continuous>() == 0 { NonNull::dangling() } else { NonNull::new_unchecked(x.cast_mut().cast()) };
    at.as_ref()
}

unsafe fn instant<'a, M: Model>(instance: *const Instance<M>, t: f64, x: *const f64) -> Instant<'a, M> {
    Instant {
        t,
        x: states::<M>(x),
        inputs: &(*instance).inputs,
        parameters: &(*instance).parameters,
        state: &(*instance).state,
    }
}

unsafe extern "C" fn init<M: Init>(instance: *mut c_void, context: *const ModelContext) -> *const c_char {
    match M::init(&mut *instance.cast(), &Context(&*context)) {
        Ok(()) => core::ptr::null(),
        Err(reason) => reason.as_ptr(),
    }
}

unsafe extern "C" fn derivative<M: Derivative>(instance: *const c_void, t: f64, x: *const f64, dx: *mut f64) {
    dx.cast::<M::Continuous>().write(M::derivative(&instant::<M>(instance.cast(), t, x)));
}

unsafe extern "C" fn output<M: Output>(instance: *mut c_void, t: f64, x: *const f64) {
    let instance = instance.cast::<Instance<M>>();
    M::output(&instant::<M>(instance, t, x), &mut (*instance).outputs);
}

unsafe extern "C" fn update<M: Update>(instance: *mut c_void, context: *const ModelContext) {
    M::update(&mut *instance.cast(), &Context(&*context));
}

unsafe extern "C" fn event<M: Event, const N: usize>(instance: *const c_void, t: f64, x: *const f64, values: *mut f64) {
    M::event(&instant::<M>(instance.cast(), t, x), &mut *values.cast::<[f64; N]>());
}

unsafe extern "C" fn reset<M: Reset>(instance: *mut c_void, context: *const ModelContext, number: u32) {
    M::reset(&mut *instance.cast(), &Context(&*context), number as usize);
}

unsafe extern "C" fn next_time<M: NextTime>(instance: *const c_void, t: f64) -> f64 {
    let instance = instance.cast::<Instance<M>>();
    M::next_time(t, &(*instance).parameters, &(*instance).state)
}

/// The functions that a model has. `Functions::<M, N>::INIT` is the inherent constant, with the function, where M
/// implements the trait, else that of `Without`.
pub struct Functions<M, const N: usize>(PhantomData<M>);

pub trait Without {
    const INIT: Option<InitFn> = None;
    const DERIVATIVE: Option<DerivativeFn> = None;
    const OUTPUT: Option<OutputFn> = None;
    const UPDATE: Option<UpdateFn> = None;
    const EVENT: Option<EventFn> = None;
    const RESET: Option<ResetFn> = None;
    const NEXT_TIME: Option<NextTimeFn> = None;
}
impl<M, const N: usize> Without for Functions<M, N> {}

impl<M: Init, const N: usize> Functions<M, N> {
    pub const INIT: Option<InitFn> = Some(init::<M>);
}
impl<M: Derivative, const N: usize> Functions<M, N> {
    pub const DERIVATIVE: Option<DerivativeFn> = Some(derivative::<M>);
}
impl<M: Output, const N: usize> Functions<M, N> {
    pub const OUTPUT: Option<OutputFn> = Some(output::<M>);
}
impl<M: Update, const N: usize> Functions<M, N> {
    pub const UPDATE: Option<UpdateFn> = Some(update::<M>);
}
impl<M: Event, const N: usize> Functions<M, N> {
    pub const EVENT: Option<EventFn> = Some(event::<M, N>);
}
impl<M: Reset, const N: usize> Functions<M, N> {
    pub const RESET: Option<ResetFn> = Some(reset::<M>);
}
impl<M: NextTime, const N: usize> Functions<M, N> {
    pub const NEXT_TIME: Option<NextTimeFn> = Some(next_time::<M>);
}
