// SPDX-License-Identifier: Apache-2.0
//! fcsl_mcap_*: contracts are in fcsl/fcsl_mcap_writer.h.

mod chunk;
mod chunk_file;
mod growing_file;
mod packer;
mod records;
mod writer;

use std::ffi::{c_char, CString};
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::fd::AsRawFd;

use crate::c::{self, Reason};
use writer::Writer;

/// What create_new says, on every Unix.
const EEXIST: i32 = 17;

extern "C" {
    fn flock(fd: i32, operation: i32) -> i32;
}
const LOCK_EX: i32 = 2;

/// Marks a file as being written, for `simclient.bag repair`, which must not touch it; until this process ends or closes it.
fn lock(file: &File) {
    // SAFETY: the descriptor is open. Nobody else has the file, so this does not wait; a file system without locks refuses.
    let _ = unsafe { flock(file.as_raw_fd(), LOCK_EX) };
}

pub struct Mcap {
    writer: Writer,
    /// Set once a write failed: a chunk is missing, so nothing may follow.
    failed: Option<Reason>,
    /// What fcsl_mcap_error returns.
    error: CString,
}

fn reason_of(error: &io::Error) -> Reason {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_owned()
}

impl Mcap {
    fn open(path: &str) -> Result<Self, Reason> {
        let writer = Self::begin(path).map_err(|e| reason_of(&e))?;
        Ok(Self { writer, failed: None, error: CString::default() })
    }

    /// The file takes its name when it is a recording, if an empty one: a process that is killed leaves none that nobody reads.
    fn begin(path: &str) -> io::Result<Writer> {
        if fs::exists(path)? {
            return Err(io::Error::from_raw_os_error(EEXIST));
        }
        let unnamed = format!("{path}.tmp");
        let file = OpenOptions::new().write(true).create(true).truncate(true).open(&unnamed)?;
        lock(&file);
        let begun = Writer::new(file, "ros2", "fcsl").and_then(|writer| fs::rename(&unnamed, path).map(|()| writer));
        if begun.is_err() {
            let _ = fs::remove_file(&unnamed);
        }
        begun
    }

    /// The writer, unless an earlier write failed.
    fn sound(&mut self) -> Result<&mut Writer, Reason> {
        match &self.failed {
            Some(reason) => Err(reason.clone()),
            None => Ok(&mut self.writer),
        }
    }

    /// Runs `action` on the writer and remembers a failure: the file is then unfit for more.
    fn attempt<T>(&mut self, action: impl FnOnce(&mut Writer) -> io::Result<T>) -> Result<T, Reason> {
        action(self.sound()?).map_err(|error| {
            let reason = reason_of(&error);
            self.failed = Some(reason.clone());
            reason
        })
    }

    fn close(self, durable: bool) -> Result<(), Reason> {
        match self.failed {
            Some(reason) => Err(reason),
            None => self.writer.finish(durable).map_err(|e| reason_of(&e)),
        }
    }
}

/// Runs `action` on a recording and turns its result into what C gets.
///
/// # Safety
/// `mcap` is null or came from fcsl_mcap_open and was not closed.
unsafe fn call<T: Into<i64>>(mcap: *mut Mcap, action: impl FnOnce(&mut Mcap) -> Result<T, Reason>) -> i64 {
    // SAFETY: the caller's promise, and one thread at a time (the header's contract).
    let Some(mcap) = (unsafe { mcap.as_mut() }) else { return -1 };
    match action(mcap) {
        Ok(value) => value.into(),
        Err(reason) => {
            mcap.error = CString::new(reason.replace('\0', "?")).unwrap_or_default();
            -1
        }
    }
}

/// # Safety
/// As fcsl_mcap_writer.h: `path` a string, `out` writable, `error` null or `error_size` writable bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_open(
    path: *const c_char,
    out: *mut *mut Mcap,
    error: *mut c_char,
    error_size: usize,
) -> i32 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        if out.is_null() {
            c::message("out is null", error, error_size);
            return -1;
        }
        *out = std::ptr::null_mut();
        match c::string(path, "path").and_then(Mcap::open) {
            Ok(mcap) => {
                *out = Box::into_raw(Box::new(mcap));
                0
            }
            Err(reason) => {
                c::message(&reason, error, error_size);
                -1
            }
        }
    }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_add_schema(
    mcap: *mut Mcap,
    name: *const c_char,
    encoding: *const c_char,
    data: *const u8,
    size: usize,
) -> i64 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        call(mcap, |mcap| {
            let name = c::string(name, "the schema's name")?;
            let encoding = c::string(encoding, "the schema's encoding")?;
            let data = c::bytes(data, size, "the schema")?;
            mcap.sound()?.add_schema(name, encoding, data).ok_or_else(|| "there are 65535 schemas already".into())
        })
    }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_add_channel(
    mcap: *mut Mcap,
    topic: *const c_char,
    schema_id: u16,
    message_encoding: *const c_char,
    keys: *const *const c_char,
    values: *const *const c_char,
    count: usize,
) -> i64 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        call(mcap, |mcap| {
            let topic = c::string(topic, "the topic")?;
            let encoding = c::string(message_encoding, "the message encoding")?;
            let metadata = c::pairs(keys, values, count)?;
            let writer = mcap.sound()?;
            if schema_id != 0 && !writer.has_schema(schema_id) {
                return Err(format!("there is no schema number {schema_id}"));
            }
            let id = writer.add_channel(schema_id, topic, encoding, &metadata);
            id.ok_or_else(|| "there are 65536 topics already".into())
        })
    }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_write(
    mcap: *mut Mcap,
    channel_id: u16,
    sequence: u32,
    log_time_ns: u64,
    publish_time_ns: u64,
    data: *const u8,
    size: usize,
) -> i32 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        call(mcap, |mcap| {
            let data = c::bytes(data, size, "the message")?;
            let known =
                mcap.attempt(|writer| writer.message(channel_id, sequence, log_time_ns, publish_time_ns, data))?;
            if known {
                Ok(0)
            } else {
                Err(format!("there is no channel number {channel_id}"))
            }
        }) as i32
    }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_add_metadata(
    mcap: *mut Mcap,
    name: *const c_char,
    keys: *const *const c_char,
    values: *const *const c_char,
    count: usize,
) -> i32 {
    // SAFETY: the header's contract, for every pointer of this call.
    unsafe {
        call(mcap, |mcap| {
            let name = c::string(name, "the metadata's name")?;
            let metadata = c::pairs(keys, values, count)?;
            mcap.attempt(|writer| writer.add_metadata(name, &metadata)).map(|()| 0)
        }) as i32
    }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_flush(mcap: *mut Mcap) -> i32 {
    // SAFETY: the header's contract.
    unsafe { call(mcap, |mcap| mcap.attempt(Writer::flush).map(|()| 0)) as i32 }
}

/// # Safety
/// As fcsl_mcap_writer.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_error(mcap: *const Mcap) -> *const c_char {
    // SAFETY: the header's contract.
    match unsafe { mcap.as_ref() } {
        Some(mcap) => mcap.error.as_ptr(),
        None => c"no recording (null)".as_ptr(),
    }
}

/// # Safety
/// As fcsl_mcap_writer.h; `mcap` is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_close(mcap: *mut Mcap, error: *mut c_char, error_size: usize) -> i32 {
    // SAFETY: the header's contract.
    unsafe { close(mcap, true, error, error_size) }
}

/// # Safety
/// As fcsl_mcap_writer.h; `mcap` is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_end(mcap: *mut Mcap, error: *mut c_char, error_size: usize) -> i32 {
    // SAFETY: the header's contract.
    unsafe { close(mcap, false, error, error_size) }
}

/// # Safety
/// As fcsl_mcap_writer.h.
unsafe fn close(mcap: *mut Mcap, durable: bool, error: *mut c_char, error_size: usize) -> i32 {
    if mcap.is_null() {
        return 0;
    }
    // SAFETY: not null, came from Box::into_raw in fcsl_mcap_open, and ownership ends here.
    match unsafe { Box::from_raw(mcap) }.close(durable) {
        Ok(()) => 0,
        Err(reason) => {
            // SAFETY: the header's contract.
            unsafe { c::message(&reason, error, error_size) };
            -1
        }
    }
}

/// # Safety
/// As fcsl_mcap_writer.h. Null counts as no bytes.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_crc32(data: *const u8, size: usize) -> u32 {
    // SAFETY: the header's contract.
    crc32fast::hash(unsafe { c::bytes(data, size, "data") }.unwrap_or(&[]))
}
