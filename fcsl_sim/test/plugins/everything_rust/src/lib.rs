// SPDX-License-Identifier: Apache-2.0
//! `everything_c.c` in Rust. `inputs.count` above 2 makes its update panic.
#![no_std]

use core::ffi::CStr;

use fcsl_model::{Context, Derivative, Event, Init, Instance, Instant, Math, NextTime, Output, Reset, Update};

fcsl_model::model! {
    /// every function, every type
    pub Everything as "everything_rust";

    inputs {
        /// of the air
        wind: [f64; 3] = "m/s";
        count: i32 = "", optional;
        enabled: bool = "";
    }
    parameters {
        /// two rows of three
        gain: [[f32; 3]; 2] = "";
        limit: u64 = "";
        identity: i64 = "", optional;
        curve: [f64; 4] = "N", table;
    }
    second_order continuous {
        position: f64 = "m";
        speed: f64 = "m/s";
    }
    state {
        updates: u32 = "";
        last_event: u32 = "";
    }
    outputs {
        value: f64 = "m", feedthrough;
        /// of noise
        sample: [f64; 2] = "";
        sampled: bool = "";
    }
    sampled sampled;
    events {
        /// the position becomes negative
        ground: falling;
        second: either;
    }
}

impl Init for Everything {
    fn init(it: &mut Instance<Everything>, context: &Context) -> Result<(), &'static CStr> {
        if it.parameters.limit == 0 {
            return Err(c"parameters.limit must not be 0");
        }
        it.continuous.position = 1.0 + context.time_ns() as f64;
        Ok(())
    }
}

impl Derivative for Everything {
    fn derivative(now: &Instant<Everything>) -> Continuous {
        let push = now.inputs.wind[0] - now.x.position + f64::from(now.parameters.gain[1][2]) * now.t;
        Continuous { position: now.x.speed, speed: push }
    }
}

impl Output for Everything {
    fn output(now: &Instant<Everything>, outputs: &mut Outputs) {
        outputs.value = now.inputs.wind[2] + now.x.position.sin() + now.t.sqrt();
    }
}

impl Update for Everything {
    fn update(it: &mut Instance<Everything>, context: &Context) {
        it.state.updates += 1;
        it.outputs.sample = [context.gaussian(1), context.uniform(2)];
        it.outputs.sampled = it.inputs.enabled;
        let _ = core::hint::black_box(it.inputs.wind[it.inputs.count as usize]);
    }
}

impl Event for Everything {
    fn event(now: &Instant<Everything>, values: &mut [f64]) {
        values[0] = now.x.position;
        values[1] = now.t - 1.0;
    }
}

impl Reset for Everything {
    fn reset(it: &mut Instance<Everything>, _: &Context, number: usize) {
        it.continuous.speed = -it.continuous.speed;
        it.state.last_event = number as u32;
    }
}

impl NextTime for Everything {
    fn next_time(t: f64, parameters: &Parameters, _: &State) -> f64 {
        t + parameters.identity as f64
    }
}
