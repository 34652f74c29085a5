// SPDX-License-Identifier: Apache-2.0
//! MCAP records as bytes (the format's specification, section "Records"): little-endian, strings, maps and arrays behind
//! their size in bytes.

use std::collections::BTreeMap;

pub const MAGIC: &[u8] = b"\x89MCAP0\r\n";

pub const HEADER: u8 = 0x01;
pub const FOOTER: u8 = 0x02;
pub const SCHEMA: u8 = 0x03;
pub const CHANNEL: u8 = 0x04;
pub const MESSAGE: u8 = 0x05;
pub const CHUNK: u8 = 0x06;
pub const MESSAGE_INDEX: u8 = 0x07;
pub const CHUNK_INDEX: u8 = 0x08;
pub const STATISTICS: u8 = 0x0b;
pub const METADATA: u8 = 0x0c;
pub const METADATA_INDEX: u8 = 0x0d;
pub const SUMMARY_OFFSET: u8 = 0x0e;
pub const DATA_END: u8 = 0x0f;

/// Puts values behind one another into `out`.
pub struct Put<'a>(pub &'a mut Vec<u8>);

impl Put<'_> {
    pub fn u8(&mut self, value: u8) {
        self.0.push(value);
    }

    pub fn u16(&mut self, value: u16) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub fn u32(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub fn u64(&mut self, value: u64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub fn bytes(&mut self, value: &[u8]) {
        self.u32(value.len() as u32);
        self.0.extend_from_slice(value);
    }

    pub fn string(&mut self, value: &str) {
        self.bytes(value.as_bytes());
    }

    pub fn strings(&mut self, map: &BTreeMap<String, String>) {
        let mut entries = Vec::new();
        for (key, value) in map {
            Put(&mut entries).string(key);
            Put(&mut entries).string(value);
        }
        self.bytes(&entries);
    }

    pub fn numbers(&mut self, map: impl ExactSizeIterator<Item = (u16, u64)>) {
        self.u32(map.len() as u32 * 10);
        for (key, value) in map {
            self.u16(key);
            self.u64(value);
        }
    }
}

/// Appends a record whose content `put` makes.
pub fn record(out: &mut Vec<u8>, opcode: u8, put: impl FnOnce(&mut Put)) {
    out.push(opcode);
    let at = out.len();
    out.extend_from_slice(&[0; 8]);
    put(&mut Put(out));
    let length = (out.len() - at - 8) as u64;
    out[at..at + 8].copy_from_slice(&length.to_le_bytes());
}

/// A record by itself.
pub fn alone(opcode: u8, put: impl FnOnce(&mut Put)) -> Vec<u8> {
    let mut out = Vec::new();
    record(&mut out, opcode, put);
    out
}
