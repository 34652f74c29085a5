// SPDX-License-Identifier: Apache-2.0
//! Messages gathered in memory, and compressed as a whole: one call of the compressor per chunk costs a fraction of one
//! call per message.

use std::io;

use super::records::{self, Put};

/// zstd's fastest regular level: a recorder must keep up, and telemetry compresses well at any level.
const COMPRESSION_LEVEL: i32 = 1;
/// Of zstd's hash table, as a power of two: with 16 KiB it stays in a processor's first cache. Messages repeat at short
/// distances, so that a larger one finds no more.
const HASH_LOG: u32 = 12;
/// Of a message: opcode, length, channel, sequence, two times.
const MESSAGE_HEAD_BYTES: usize = 1 + 8 + 2 + 4 + 8 + 8;

/// Times of messages, and where each lies in its chunk, as the file has them.
type Index = Vec<u8>;
const INDEX_ENTRY_BYTES: usize = 16;

pub struct Chunk {
    records: Vec<u8>,
    /// By channel number.
    indexes: Vec<Index>,
    /// Channels that have messages in this chunk.
    used: Vec<u16>,
    first_ns: u64,
    last_ns: u64,
    compressor: zstd::bulk::Compressor<'static>,
    compressed: Vec<u8>,
}

/// A chunk as it goes into the file, and what its index says of it.
pub struct Sealed {
    pub first_ns: u64,
    pub last_ns: u64,
    pub chunk_bytes: u64,
    /// Per channel: where its index lies, from the beginning of the chunk.
    pub index_offsets: Vec<(u16, u64)>,
    pub index_bytes: u64,
    pub compressed_bytes: u64,
    pub uncompressed_bytes: u64,
}

impl Chunk {
    pub fn new() -> io::Result<Self> {
        let mut compressor = zstd::bulk::Compressor::new(COMPRESSION_LEVEL)?;
        compressor.set_parameter(zstd::zstd_safe::CParameter::HashLog(HASH_LOG))?;
        Ok(Self {
            records: Vec::new(),
            indexes: Vec::new(),
            used: Vec::new(),
            first_ns: u64::MAX,
            last_ns: 0,
            compressor,
            compressed: Vec::new(),
        })
    }

    pub fn bytes(&self) -> usize {
        self.records.len()
    }

    /// A definition: schemas and channels stand before the messages that need them.
    pub fn define(&mut self, record: &[u8]) {
        self.records.extend_from_slice(record);
    }

    pub fn message(&mut self, channel: u16, sequence: u32, log_ns: u64, publish_ns: u64, data: &[u8]) {
        if usize::from(channel) >= self.indexes.len() {
            self.indexes.resize_with(usize::from(channel) + 1, Index::new);
        }
        let index = &mut self.indexes[usize::from(channel)];
        if index.is_empty() {
            self.used.push(channel);
        }
        let mut entry = [0; INDEX_ENTRY_BYTES];
        entry[..8].copy_from_slice(&log_ns.to_le_bytes());
        entry[8..].copy_from_slice(&(self.records.len() as u64).to_le_bytes());
        index.extend_from_slice(&entry);
        self.first_ns = self.first_ns.min(log_ns);
        self.last_ns = self.last_ns.max(log_ns);

        let mut head = [0; MESSAGE_HEAD_BYTES];
        head[0] = records::MESSAGE;
        head[1..9].copy_from_slice(&((MESSAGE_HEAD_BYTES - 9 + data.len()) as u64).to_le_bytes());
        head[9..11].copy_from_slice(&channel.to_le_bytes());
        head[11..15].copy_from_slice(&sequence.to_le_bytes());
        head[15..23].copy_from_slice(&log_ns.to_le_bytes());
        head[23..31].copy_from_slice(&publish_ns.to_le_bytes());
        self.records.reserve(MESSAGE_HEAD_BYTES + data.len());
        self.records.extend_from_slice(&head);
        self.records.extend_from_slice(data);
    }

    /// Puts the chunk and its message indexes into `out` and begins the next one.
    pub fn seal(&mut self, out: &mut Vec<u8>) -> io::Result<Sealed> {
        self.compressed.clear();
        self.compressed.reserve(zstd::zstd_safe::compress_bound(self.records.len()));
        let compressed_bytes = self.compressor.compress_to_buffer(&self.records, &mut self.compressed)? as u64;
        let (begin, uncompressed_bytes) = (out.len(), self.records.len() as u64);
        let first_ns = if self.used.is_empty() { 0 } else { self.first_ns };
        records::record(out, records::CHUNK, |put| {
            put.u64(first_ns);
            put.u64(self.last_ns);
            put.u64(uncompressed_bytes);
            put.u32(crc32fast::hash(&self.records));
            put.string("zstd");
            put.u64(compressed_bytes);
            put.0.extend_from_slice(&self.compressed);
        });
        let chunk_bytes = (out.len() - begin) as u64;
        self.used.sort_unstable();
        let mut index_offsets = Vec::with_capacity(self.used.len());
        for &channel in &self.used {
            index_offsets.push((channel, (out.len() - begin) as u64));
            put_index(out, channel, &self.indexes[usize::from(channel)]);
            self.indexes[usize::from(channel)].clear();
        }
        let sealed = Sealed {
            first_ns,
            last_ns: self.last_ns,
            chunk_bytes,
            index_offsets,
            index_bytes: (out.len() - begin) as u64 - chunk_bytes,
            compressed_bytes,
            uncompressed_bytes,
        };
        self.records.clear();
        self.used.clear();
        self.first_ns = u64::MAX;
        self.last_ns = 0;
        Ok(sealed)
    }
}

fn put_index(out: &mut Vec<u8>, channel: u16, index: &Index) {
    records::record(out, records::MESSAGE_INDEX, |put: &mut Put| {
        put.u16(channel);
        put.bytes(index);
    });
}
