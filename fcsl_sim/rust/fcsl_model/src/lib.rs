// SPDX-License-Identifier: Apache-2.0
//! Models of the FCSL simulator in Rust: the ABI of `fcsl/fcsl_model.h` behind safe traits.
//!
//! [`model!`] declares the ports and states of a model and exports it. The traits below are its functions; a model
//! implements those that it has. All of them but [`Model`] are optional.
//!
//! ```ignore
//! #![no_std]
//! fcsl_model::model! {
//!     /// a mass on a spring
//!     pub Spring as "spring";
//!     inputs { /// of the motor
//!         force: f64 = "N"; }
//!     parameters { mass: f64 = "kg"; stiffness: f64 = "N/m"; }
//!     continuous { position: f64 = "m"; speed: f64 = "m/s"; }
//!     outputs { position: f64 = "m"; acceleration: f64 = "m/s^2", feedthrough; }
//! }
//! ```
//!
//! This makes the structs `Inputs`, `Parameters`, `Continuous`, `State`, `Outputs`, and the type `Spring`. Inputs and
//! parameters are read-only, and outputs are a struct of their own, so no function sees memory that another argument
//! changes.
//! A model is `#![no_std]`: it cannot allocate, and a panic prints its message and ends the simulator.
#![no_std]

pub mod abi;
mod calls;
mod context;
mod field;
mod macros;
mod math;
mod panic;

pub use context::Context;
pub use field::Value;
pub use math::Math;

#[doc(hidden)]
pub mod detail {
    pub use crate::abi::*;
    pub use crate::calls::*;
    pub use crate::field::*;
    pub use crate::panic::abort;
    pub use core::ffi::CStr;
    pub use core::mem::offset_of;
}

use core::ffi::CStr;

/// The structs of a model. [`model!`] implements this.
pub trait Model: Sized {
    type Inputs;
    type Parameters;
    /// The integrated states: `f64` alone.
    type Continuous: Copy;
    /// The other states, which `init`, `update` and `reset` change.
    type State;
    type Outputs;
}

/// One instance of a model, as the simulator holds it.
#[repr(C)]
pub struct Instance<M: Model> {
    pub inputs: M::Inputs,
    pub parameters: M::Parameters,
    pub continuous: M::Continuous,
    pub state: M::State,
    pub outputs: M::Outputs,
}

/// What `derivative`, `output` and `event` are computed from. `t` is in seconds; `x` are the states at `t`.
pub struct Instant<'a, M: Model> {
    pub t: f64,
    pub x: &'a M::Continuous,
    pub inputs: &'a M::Inputs,
    pub parameters: &'a M::Parameters,
    pub state: &'a M::State,
}

/// Runs after the parameters were written.
pub trait Init: Model {
    /// Checks parameters and sets states. An error is about a parameter: `Err(c"parameters.mass must be positive")`.
    fn init(instance: &mut Instance<Self>, context: &Context) -> Result<(), &'static CStr>;
}

/// Required for a model with continuous states.
pub trait Derivative: Model {
    /// dx/dt.
    fn derivative(now: &Instant<Self>) -> Self::Continuous;
}

/// At any instant, so also within a step of the integrator.
pub trait Output: Model {
    /// Writes every output.
    fn output(now: &Instant<Self>, outputs: &mut Self::Outputs);
}

/// At the rate of the instance.
pub trait Update: Model {
    /// May change any state. Writes the outputs of a model that has no `Output`.
    fn update(instance: &mut Instance<Self>, context: &Context);
}

/// For a model with `events`.
pub trait Event: Model {
    /// Writes the value of each event function; the simulator finds the instant at which its sign changes.
    fn event(now: &Instant<Self>, values: &mut [f64]);
}

/// When an event has happened.
pub trait Reset: Model {
    /// Event `number` happened, at most 1 ns ago. May change any state.
    fn reset(instance: &mut Instance<Self>, context: &Context, number: usize);
}

/// For a model whose functions jump as functions of `t`.
pub trait NextTime: Model {
    /// The next time after `t`, in seconds, at which one of them jumps; `f64::INFINITY`: none. A step ends there.
    fn next_time(t: f64, parameters: &Self::Parameters, state: &Self::State) -> f64;
}
