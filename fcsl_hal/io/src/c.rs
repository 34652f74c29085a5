// SPDX-License-Identifier: Apache-2.0
//! C arguments as Rust values, and messages back. Each function refuses null instead of trusting it.

use std::collections::BTreeMap;
use std::ffi::{c_char, CStr};

/// Reason of a failed call, for people.
pub type Reason = String;

/// # Safety
/// `text` is null or a null-terminated string that lives through the call.
pub unsafe fn string<'a>(text: *const c_char, what: &str) -> Result<&'a str, Reason> {
    if text.is_null() {
        return Err(format!("{what} is null"));
    }
    // SAFETY: not null; the caller promises the terminator.
    unsafe { CStr::from_ptr(text) }.to_str().map_err(|_| format!("{what} is not UTF-8"))
}

/// # Safety
/// `data` is null or points to `size` readable bytes that live through the call.
pub unsafe fn bytes<'a>(data: *const u8, size: usize, what: &str) -> Result<&'a [u8], Reason> {
    if size == 0 {
        return Ok(&[]);
    }
    if data.is_null() {
        return Err(format!("{what} is null"));
    }
    // SAFETY: not null; the caller promises `size` bytes.
    Ok(unsafe { std::slice::from_raw_parts(data, size) })
}

/// # Safety
/// `keys` and `values` are null or point to `count` null-terminated strings each.
pub unsafe fn pairs(
    keys: *const *const c_char,
    values: *const *const c_char,
    count: usize,
) -> Result<BTreeMap<String, String>, Reason> {
    let mut map = BTreeMap::new();
    if count == 0 {
        return Ok(map);
    }
    if keys.is_null() || values.is_null() {
        return Err("metadata is null".into());
    }
    for i in 0..count {
        // SAFETY: not null; the caller promises `count` strings in both arrays.
        let (key, value) =
            unsafe { (string(*keys.add(i), "a metadata key")?, string(*values.add(i), "a metadata value")?) };
        map.insert(key.to_owned(), value.to_owned());
    }
    Ok(map)
}

/// Copies `text`, shortened to fit and null-terminated.
///
/// # Safety
/// `out` is null or points to `size` writable bytes.
pub unsafe fn message(text: &str, out: *mut c_char, size: usize) {
    if out.is_null() || size == 0 {
        return;
    }
    let length = text.len().min(size - 1);
    // SAFETY: `length` + 1 bytes fit into `out`, which does not overlap Rust's own string.
    unsafe {
        std::ptr::copy_nonoverlapping(text.as_ptr(), out.cast::<u8>(), length);
        *out.add(length) = 0;
    }
}
