// SPDX-License-Identifier: Apache-2.0
//! A recording that grows: whoever reads what is on disk from its start comes to an end that MCAP knows, at any time.

use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::os::unix::fs::FileExt;

/// Records DataEnd and Footer, without a summary, and the magic: with these a reader goes through the file from its start.
const TAIL: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";

/// Gathers what is written; flush() appends it and the tail, and the next flush() writes over that tail: last of all, when
/// all that belongs behind it is there. A process that is killed leaves the state of its last flush(), with bytes behind
/// that state's tail if it was killed within the next one.
pub struct GrowingFile {
    file: File,
    /// Bytes of the file before its tail.
    end: u64,
    pending: Vec<u8>,
}

impl GrowingFile {
    pub fn new(file: File) -> Self {
        Self { file, end: 0, pending: Vec::new() }
    }

    /// The file without the tail, for one that brought its own end.
    pub fn into_complete(self) -> io::Result<File> {
        self.file.set_len(self.end)?;
        Ok(self.file)
    }

    fn append(&mut self) -> io::Result<()> {
        self.pending.extend_from_slice(TAIL);
        let old_tail = if self.end == 0 { 0 } else { TAIL.len() };
        let (over_it, behind_it) = self.pending.split_at(old_tail);
        self.file.write_all_at(behind_it, self.end + old_tail as u64)?;
        self.file.write_all_at(over_it, self.end)?;
        self.end += (self.pending.len() - TAIL.len()) as u64;
        Ok(())
    }
}

impl Write for GrowingFile {
    fn write(&mut self, data: &[u8]) -> io::Result<usize> {
        self.pending.extend_from_slice(data);
        Ok(data.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let appended = self.append();
        self.pending.clear();
        if appended.is_err() {
            // The disk is full, say: there was room for the tail before.
            let _ = self.file.set_len(self.end).and_then(|()| self.file.write_all_at(TAIL, self.end));
        }
        appended
    }
}

/// Tells where it is and goes nowhere else.
impl Seek for GrowingFile {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match to {
            SeekFrom::Current(0) => Ok(self.end + self.pending.len() as u64),
            _ => Err(io::ErrorKind::Unsupported.into()),
        }
    }
}
