// SPDX-License-Identifier: Apache-2.0
fn main() {
    // Where Copper's macros keep the strings of the log.
    println!("cargo:rustc-env=LOG_INDEX_DIR={}", std::env::var("OUT_DIR").unwrap());
}
