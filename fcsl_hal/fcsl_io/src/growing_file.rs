// SPDX-License-Identifier: Apache-2.0
//! A recording that grows: whoever reads what is on disk comes to an end that MCAP knows, at any time.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// Records DataEnd and Footer, without a summary, and the magic: with these a reader goes through the file from its start.
const TAIL: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";

/// Gathers what is written; flush() appends it and the tail. The new tail is written first, far behind the old one, then
/// what lies between the two, and what goes over the old tail last of all. So a process that is killed, within a flush or
/// not, leaves a file whose end is a tail, and which from its start reads as far as the old tail, or the new one.
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

    /// Where the next byte goes.
    pub fn position(&self) -> u64 {
        self.end + self.pending.len() as u64
    }

    pub fn write(&mut self, data: &[u8]) {
        self.pending.extend_from_slice(data);
    }

    pub fn flush(&mut self) -> io::Result<()> {
        let appended = self.append();
        self.pending.clear();
        if appended.is_err() {
            // The disk is full, say: there was room for the tail before.
            let _ = self.file.set_len(self.end).and_then(|()| self.file.write_all_at(TAIL, self.end));
        }
        appended
    }

    /// The file without the tail, for one that brought its own end.
    pub fn into_complete(self) -> io::Result<File> {
        self.file.set_len(self.end)?;
        Ok(self.file)
    }

    fn append(&mut self) -> io::Result<()> {
        let bytes = self.pending.len();
        let (old_end, old_tail) = (self.end, TAIL.len() as u64);
        if old_end == 0 || bytes < TAIL.len() {
            self.pending.extend_from_slice(TAIL);
            self.file.write_all_at(&self.pending, old_end)?;
        } else {
            let (over_it, behind_it) = self.pending.split_at(TAIL.len());
            self.file.write_all_at(TAIL, old_end + bytes as u64)?;
            self.file.write_all_at(behind_it, old_end + old_tail)?;
            self.file.write_all_at(over_it, old_end)?;
        }
        self.end += bytes as u64;
        Ok(())
    }
}
