// SPDX-License-Identifier: Apache-2.0
//! Services that a model may use in `init`, `update` and `reset`.

use crate::abi::ModelContext;

/// Time and noise of an instance.
pub struct Context<'a>(pub(crate) &'a ModelContext);

impl Context<'_> {
    /// Time since the beginning, ns.
    pub fn time_ns(&self) -> i64 {
        self.0.time_ns
    }

    /// The next number of a stream of noise: mean 0, standard deviation 1. NaN: no such stream.
    pub fn gaussian(&self, stream: u32) -> f64 {
        // SAFETY: the simulator's function, with its own argument.
        unsafe { (self.0.gaussian)(self.0.noise, stream) }
    }

    /// The next number of a stream of noise, in [0, 1). NaN: no such stream.
    pub fn uniform(&self, stream: u32) -> f64 {
        // SAFETY: as above.
        unsafe { (self.0.uniform)(self.0.noise, stream) }
    }
}
