// SPDX-License-Identifier: Apache-2.0
//! fcsl_mcap_*: contracts are in fcsl/fcsl_io.h.

use std::ffi::{c_char, CString};
use std::fs::OpenOptions;
use std::io;

use mcap::records::{MessageHeader, Metadata};
use mcap::{Compression, McapError, WriteOptions, Writer};

use crate::c::{self, Reason};
use crate::growing_file::GrowingFile;

/// FCSL_MCAP_CHUNK_BYTES of the header.
const CHUNK_BYTES: usize = 256 * 1024;
/// zstd's fastest regular level: a recorder must keep up, and telemetry compresses well at any level.
const COMPRESSION_LEVEL: u32 = 1;

pub struct Mcap {
    writer: Writer<GrowingFile>,
    /// Message bytes since the last chunk was ended.
    pending: usize,
    /// Set once a write failed: a chunk is missing, so nothing may follow.
    failed: Option<Reason>,
    /// What fcsl_mcap_error returns.
    error: CString,
}

fn reason_of_io(error: &io::Error) -> Reason {
    let text = error.to_string();
    text.split(" (os error").next().unwrap_or(&text).to_owned()
}

fn reason_of(error: McapError) -> Reason {
    match error {
        McapError::Io(error) => reason_of_io(&error),
        other => other.to_string(),
    }
}

/// Errors that come from the arguments; the file is as good as before.
fn harmless(error: &McapError) -> bool {
    matches!(
        error,
        McapError::UnknownSchema(..)
            | McapError::UnknownChannel(..)
            | McapError::TooManyChannels
            | McapError::TooManySchemas
    )
}

impl Mcap {
    fn open(path: &str) -> Result<Self, Reason> {
        let file = OpenOptions::new().write(true).create_new(true).open(path).map_err(|e| reason_of_io(&e))?;
        let mut writer = WriteOptions::new()
            .profile("ros2")
            .library("fcsl")
            .compression(Some(Compression::Zstd))
            .compression_level(COMPRESSION_LEVEL)
            .compression_threads(0)
            .chunk_size(None) // write() ends chunks itself, to hand each to the operating system at once
            .disable_seeking(true) // append only: a chunk is written when it is complete
            .create(GrowingFile::new(file))
            .map_err(reason_of)?;
        writer.flush().map_err(reason_of)?; // a recording from the start, if an empty one
        Ok(Self { writer, pending: 0, failed: None, error: CString::default() })
    }

    /// Runs `action` unless an earlier write failed; remembers a failure that leaves the file unfit for more.
    fn attempt<T>(&mut self, action: impl FnOnce(&mut Self) -> Result<T, McapError>) -> Result<T, Reason> {
        if let Some(reason) = &self.failed {
            return Err(reason.clone());
        }
        action(self).map_err(|error| {
            let stays_good = harmless(&error);
            let reason = reason_of(error);
            if !stays_good {
                self.failed = Some(reason.clone());
            }
            reason
        })
    }

    fn end_chunk(&mut self) -> Result<(), McapError> {
        self.pending = 0;
        self.writer.flush()
    }

    fn write(&mut self, header: &MessageHeader, data: &[u8]) -> Result<(), McapError> {
        self.writer.write_to_known_channel(header, data)?;
        self.pending += data.len();
        if self.pending >= CHUNK_BYTES {
            self.end_chunk()
        } else {
            Ok(())
        }
    }

    fn close(mut self) -> Result<(), Reason> {
        let finished = self.attempt(|mcap| mcap.writer.finish().map(|_| ()));
        let file = self.writer.into_inner();
        finished?;
        file.into_complete().and_then(|file| file.sync_all()).map_err(|e| reason_of_io(&e))
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
/// As fcsl_io.h: `path` a string, `out` writable, `error` null or `error_size` writable bytes.
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
/// As fcsl_io.h.
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
            mcap.attempt(|m| m.writer.add_schema(name, encoding, data))
        })
    }
}

/// # Safety
/// As fcsl_io.h.
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
            mcap.attempt(|m| m.writer.add_channel(schema_id, topic, encoding, &metadata))
        })
    }
}

/// # Safety
/// As fcsl_io.h.
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
            let header = MessageHeader { channel_id, sequence, log_time: log_time_ns, publish_time: publish_time_ns };
            mcap.attempt(|m| m.write(&header, data)).map(|()| 0)
        }) as i32
    }
}

/// # Safety
/// As fcsl_io.h.
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
            let record = Metadata {
                name: c::string(name, "the metadata's name")?.to_owned(),
                metadata: c::pairs(keys, values, count)?,
            };
            mcap.attempt(|m| m.writer.write_metadata(&record).and_then(|()| m.end_chunk())).map(|()| 0)
        }) as i32
    }
}

/// # Safety
/// As fcsl_io.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_flush(mcap: *mut Mcap) -> i32 {
    // SAFETY: the header's contract.
    unsafe { call(mcap, |mcap| mcap.attempt(Mcap::end_chunk).map(|()| 0)) as i32 }
}

/// # Safety
/// As fcsl_io.h.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_error(mcap: *const Mcap) -> *const c_char {
    // SAFETY: the header's contract.
    match unsafe { mcap.as_ref() } {
        Some(mcap) => mcap.error.as_ptr(),
        None => c"no recording (null)".as_ptr(),
    }
}

/// # Safety
/// As fcsl_io.h; `mcap` is not used afterwards.
#[no_mangle]
pub unsafe extern "C" fn fcsl_mcap_close(mcap: *mut Mcap, error: *mut c_char, error_size: usize) -> i32 {
    if mcap.is_null() {
        return 0;
    }
    // SAFETY: not null, came from Box::into_raw in fcsl_mcap_open, and ownership ends here.
    match unsafe { Box::from_raw(mcap) }.close() {
        Ok(()) => 0,
        Err(reason) => {
            // SAFETY: the header's contract.
            unsafe { c::message(&reason, error, error_size) };
            -1
        }
    }
}
