// SPDX-License-Identifier: Apache-2.0
//! A panic of a model: its message on standard error, and the end of the simulator. It never unwinds into it.

use core::ffi::{c_int, c_void};
use core::fmt::{self, Write};
use core::panic::PanicInfo;

extern "C" {
    #[link_name = "write"]
    fn c_write(file: c_int, data: *const c_void, size: usize) -> isize;
    #[link_name = "abort"]
    fn c_abort() -> !;
}

struct StandardError;

impl Write for StandardError {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        // SAFETY: reads a string. What cannot be written is lost; the process ends anyway.
        unsafe { c_write(2, text.as_ptr().cast(), text.len()) };
        Ok(())
    }
}

/// The panic handler of a model.
pub fn abort(model: &str, info: &PanicInfo) -> ! {
    let _ = writeln!(StandardError, "model `{model}` {info}");
    // SAFETY: ends the process.
    unsafe { c_abort() }
}
