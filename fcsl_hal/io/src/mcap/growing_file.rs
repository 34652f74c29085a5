// SPDX-License-Identifier: Apache-2.0
//! A recording that grows: whoever reads what is on disk comes to an end that MCAP knows, at any time.

use std::fs::File;
use std::io;
use std::os::unix::fs::FileExt;

/// Records DataEnd and Footer, without a summary, and the magic: with these a reader goes through the file from its start.
const TAIL: &[u8] = b"\x0f\x04\0\0\0\0\0\0\0\0\0\0\0\
    \x02\x14\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\0\
    \x89MCAP0\r\n";

/// What is not yet written: a private record, which readers pass over, from the end of the content to the tail.
const ROOM: u8 = 0x80;
const ROOM_HEAD_BYTES: usize = 9;
/// Most bytes of room that are added at a time; less while the file is small.
const ROOM_BYTES: u64 = 1 << 20;

/// Gathers what is written; flush() puts it on disk. Behind the content lies room, then the tail: what is new goes into the
/// room, its first bytes last, which takes it out of the room at one stroke. So a process that is killed, within a flush or
/// not, leaves a file that every reader understands, from its start and from its end, and so does a disk that is full. Only
/// while the tail moves on, once per MiB, it is for two system calls twice in the file: most readers stop at the first.
pub struct GrowingFile {
    file: File,
    /// Bytes of content.
    end: u64,
    tail_at: u64,
    pending: Vec<u8>,
}

fn room_head(bytes: u64) -> [u8; ROOM_HEAD_BYTES] {
    let mut head = [ROOM; ROOM_HEAD_BYTES];
    head[1..].copy_from_slice(&bytes.to_le_bytes());
    head
}

impl GrowingFile {
    pub fn new(file: File) -> Self {
        Self { file, end: 0, tail_at: 0, pending: Vec::new() }
    }

    /// Where the next byte goes.
    pub fn position(&self) -> u64 {
        self.end + self.pending.len() as u64
    }

    /// Whole records, or what begins the file.
    pub fn write(&mut self, data: &[u8]) {
        self.pending.extend_from_slice(data);
    }

    pub fn flush(&mut self) -> io::Result<()> {
        let put = self.put();
        self.pending.clear();
        put
    }

    /// The file without room and tail, for one that brought its own end.
    pub fn into_complete(self) -> io::Result<File> {
        self.file.set_len(self.end)?;
        Ok(self.file)
    }

    fn put(&mut self) -> io::Result<()> {
        let content_bytes = self.pending.len() as u64;
        let least = self.end + content_bytes + ROOM_HEAD_BYTES as u64;
        if content_bytes == 0 {
            return Ok(());
        }
        if self.end == 0 {
            self.pending.extend_from_slice(&room_head(0));
            self.pending.extend_from_slice(TAIL);
            self.file.write_all_at(&self.pending, 0)?;
            self.tail_at = least;
        } else {
            if least > self.tail_at {
                self.make_room(least)?;
            }
            self.pending.extend_from_slice(&room_head(self.tail_at - least));
            let (first, others) = self.pending.split_at(ROOM_HEAD_BYTES);
            self.file.write_all_at(others, self.end + ROOM_HEAD_BYTES as u64)?;
            self.file.write_all_at(first, self.end)?;
        }
        self.end += content_bytes;
        Ok(())
    }

    /// Moves the tail to `least` or farther; where the file must not become that large, no farther than that.
    fn make_room(&mut self, least: u64) -> io::Result<()> {
        let least = least.max(self.tail_at + TAIL.len() as u64);
        self.move_tail(least + self.end.min(ROOM_BYTES)).or_else(|_| self.move_tail(least))
    }

    fn move_tail(&mut self, at: u64) -> io::Result<()> {
        let room = |tail_at: u64| room_head(tail_at - self.end - ROOM_HEAD_BYTES as u64);
        let moved = self.file.write_all_at(TAIL, at).and_then(|()| self.file.write_all_at(&room(at), self.end));
        if moved.is_ok() {
            self.tail_at = at;
        } else {
            let was = self.tail_at + TAIL.len() as u64;
            let _ = self.file.write_all_at(&room(self.tail_at), self.end).and_then(|()| self.file.set_len(was));
        }
        moved
    }
}
