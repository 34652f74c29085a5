// SPDX-License-Identifier: Apache-2.0
//! Two bodies that attract each other, in a plane:  m_i r_i'' = G m_1 m_2 (r_j - r_i) / |r_j - r_i|^3
#![no_std]

use core::ffi::CStr;

use fcsl_model::{Context, Derivative, Init, Instance, Instant, Math, Output};

/// The gravitational constant, m^3/(kg s^2) (CODATA 2022).
const G: f64 = 6.67430e-11;

fcsl_model::model! {
    /// two bodies that attract each other, in a plane
    pub Orbit as "orbit";

    parameters {
        mass: [f64; 2] = "kg";
        /// at the start
        position: [[f64; 2]; 2] = "m";
        /// at the start
        velocity: [[f64; 2]; 2] = "m/s";
    }
    second_order continuous {
        position: [[f64; 2]; 2] = "m";
        velocity: [[f64; 2]; 2] = "m/s";
    }
    outputs {
        position: [[f64; 2]; 2] = "m";
        distance: f64 = "m";
        /// kinetic and potential; constant
        energy: f64 = "J";
    }
}

impl Init for Orbit {
    fn init(orbit: &mut Instance<Orbit>, _: &Context) -> Result<(), &'static CStr> {
        let given = &orbit.parameters;
        if !(given.mass[0] > 0.0 && given.mass[1] > 0.0) {
            return Err(c"parameters.mass must be positive");
        }
        if given.position[0] == given.position[1] {
            return Err(c"parameters.position must be of two places");
        }
        orbit.continuous = Continuous { position: given.position, velocity: given.velocity };
        Ok(())
    }
}

/// From the first body to the second, and its length.
fn between(position: &[[f64; 2]; 2]) -> ([f64; 2], f64) {
    let way = [position[1][0] - position[0][0], position[1][1] - position[0][1]];
    (way, way[0].hypot(way[1]))
}

impl Derivative for Orbit {
    fn derivative(now: &Instant<Orbit>) -> Continuous {
        let (way, distance) = between(&now.x.position);
        let by = G / (distance * distance * distance);
        let mass = now.parameters.mass;
        let (first, second) = (by * mass[1], by * mass[0]);
        Continuous {
            position: now.x.velocity,
            velocity: [[first * way[0], first * way[1]], [-second * way[0], -second * way[1]]],
        }
    }
}

impl Output for Orbit {
    fn output(now: &Instant<Orbit>, outputs: &mut Outputs) {
        let (_, distance) = between(&now.x.position);
        let mass = now.parameters.mass;
        let kinetic = |i: usize| 0.5 * mass[i] * (now.x.velocity[i][0].pow(2.0) + now.x.velocity[i][1].pow(2.0));
        outputs.position = now.x.position;
        outputs.distance = distance;
        outputs.energy = kinetic(0) + kinetic(1) - G * mass[0] * mass[1] / distance;
    }
}
