// SPDX-License-Identifier: Apache-2.0
//! What C cannot have from a C library here, behind C headers. One library: two of Rust in one program collide.

mod c;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "zenoh")]
mod zenoh;
