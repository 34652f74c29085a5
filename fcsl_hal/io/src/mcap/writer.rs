// SPDX-License-Identifier: Apache-2.0
//! One MCAP file: definitions, chunks, and at the end the summary.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io;

use super::chunk::{Chunk, Sealed};
use super::growing_file::GrowingFile;
use super::records::{self, alone, record};

/// FCSL_MCAP_CHUNK_BYTES of the header.
const CHUNK_BYTES: usize = 256 * 1024;

/// Definitions of one kind by content, so that the same one again gets the same number, and as records by number.
#[derive(Default)]
struct Definitions {
    ids: HashMap<Vec<u8>, u16>,
    records: Vec<u8>,
}

pub struct Writer {
    file: GrowingFile,
    data_crc: crc32fast::Hasher,
    chunk: Chunk,
    /// What goes to the file next.
    staging: Vec<u8>,
    schemas: Definitions,
    channels: Definitions,
    message_counts: Vec<u64>,
    chunk_indexes: Vec<u8>,
    chunk_count: u32,
    metadata_indexes: Vec<u8>,
    metadata_count: u32,
    /// Of all messages; none yet: None.
    bounds_ns: Option<(u64, u64)>,
}

impl Writer {
    pub fn new(file: File, profile: &str, library: &str) -> io::Result<Self> {
        let mut writer = Self {
            file: GrowingFile::new(file),
            data_crc: crc32fast::Hasher::new(),
            chunk: Chunk::new()?,
            staging: records::MAGIC.to_vec(),
            schemas: Definitions::default(),
            channels: Definitions::default(),
            message_counts: Vec::new(),
            chunk_indexes: Vec::new(),
            chunk_count: 0,
            metadata_indexes: Vec::new(),
            metadata_count: 0,
            bounds_ns: None,
        };
        record(&mut writer.staging, records::HEADER, |put| {
            put.string(profile);
            put.string(library);
        });
        writer.put_staging();
        writer.file.flush()?; // a recording from the start, if an empty one
        Ok(writer)
    }

    /// A number from 1 on, or None when there are none left.
    pub fn add_schema(&mut self, name: &str, encoding: &str, data: &[u8]) -> Option<u16> {
        let id = u16::try_from(self.schemas.ids.len() + 1).ok();
        define(&mut self.schemas, &mut self.chunk, id, records::SCHEMA, |put| {
            put.string(name);
            put.string(encoding);
            put.bytes(data);
        })
    }

    pub fn has_schema(&self, id: u16) -> bool {
        id != 0 && usize::from(id) <= self.schemas.ids.len()
    }

    /// A number from 0 on, or None when there are none left.
    pub fn add_channel(
        &mut self,
        schema: u16,
        topic: &str,
        encoding: &str,
        metadata: &BTreeMap<String, String>,
    ) -> Option<u16> {
        let id = u16::try_from(self.channels.ids.len()).ok();
        let id = define(&mut self.channels, &mut self.chunk, id, records::CHANNEL, |put| {
            put.u16(schema);
            put.string(topic);
            put.string(encoding);
            put.strings(metadata);
        })?;
        self.message_counts.resize(self.channels.ids.len(), 0);
        Some(id)
    }

    /// Appends a message; false when there is no such channel.
    pub fn message(
        &mut self,
        channel: u16,
        sequence: u32,
        log_ns: u64,
        publish_ns: u64,
        data: &[u8],
    ) -> io::Result<bool> {
        let Some(count) = self.message_counts.get_mut(usize::from(channel)) else { return Ok(false) };
        *count += 1;
        let (first, last) = self.bounds_ns.unwrap_or((log_ns, log_ns));
        self.bounds_ns = Some((first.min(log_ns), last.max(log_ns)));
        self.chunk.message(channel, sequence, log_ns, publish_ns, data);
        if self.chunk.bytes() >= CHUNK_BYTES {
            self.flush()?;
        }
        Ok(true)
    }

    pub fn add_metadata(&mut self, name: &str, metadata: &BTreeMap<String, String>) -> io::Result<()> {
        self.end_chunk()?;
        let begin = self.file.position();
        record(&mut self.staging, records::METADATA, |put| {
            put.string(name);
            put.strings(metadata);
        });
        let length = self.staging.len() as u64;
        record(&mut self.metadata_indexes, records::METADATA_INDEX, |put| {
            put.u64(begin);
            put.u64(length);
            put.string(name);
        });
        self.metadata_count += 1;
        self.put_staging();
        self.file.flush()
    }

    /// Ends the chunk and hands all to the operating system.
    pub fn flush(&mut self) -> io::Result<()> {
        self.end_chunk()?;
        self.file.flush()
    }

    /// Writes the summary and waits until the disk has all of it.
    pub fn finish(mut self) -> io::Result<()> {
        self.end_chunk()?;
        let crc = self.data_crc.clone().finalize();
        self.staging.extend_from_slice(&alone(records::DATA_END, |put| put.u32(crc)));
        self.put_summary();
        self.put_staging();
        self.file.flush()?;
        self.file.into_complete()?.sync_all()
    }

    fn put_staging(&mut self) {
        self.data_crc.update(&self.staging);
        self.file.write(&self.staging);
        self.staging.clear();
    }

    fn end_chunk(&mut self) -> io::Result<()> {
        if self.chunk.bytes() > 0 {
            let sealed = self.chunk.seal(&mut self.staging)?;
            self.index(&sealed);
            self.put_staging();
        }
        Ok(())
    }

    fn index(&mut self, sealed: &Sealed) {
        let begin = self.file.position();
        self.chunk_count += 1;
        record(&mut self.chunk_indexes, records::CHUNK_INDEX, |put| {
            put.u64(sealed.first_ns);
            put.u64(sealed.last_ns);
            put.u64(begin);
            put.u64(sealed.chunk_bytes);
            put.numbers(sealed.index_offsets.iter().map(|&(channel, offset)| (channel, begin + offset)));
            put.u64(sealed.index_bytes);
            put.string("zstd");
            put.u64(sealed.compressed_bytes);
            put.u64(sealed.uncompressed_bytes);
        });
    }

    fn statistics(&self) -> Vec<u8> {
        let (first_ns, last_ns) = self.bounds_ns.unwrap_or((0, 0));
        let counts: Vec<_> = (0u16..).zip(self.message_counts.iter().copied()).filter(|&(_, n)| n > 0).collect();
        alone(records::STATISTICS, |put| {
            put.u64(self.message_counts.iter().sum());
            put.u16(self.schemas.ids.len() as u16);
            put.u32(self.channels.ids.len() as u32);
            put.u32(0);
            put.u32(self.metadata_count);
            put.u32(self.chunk_count);
            put.u64(first_ns);
            put.u64(last_ns);
            put.numbers(counts.into_iter());
        })
    }

    /// Appends summary, its offsets, footer and magic to what is staged.
    fn put_summary(&mut self) {
        let base = self.file.position();
        let begin = self.staging.len();
        let groups = [
            (records::SCHEMA, std::mem::take(&mut self.schemas.records)),
            (records::CHANNEL, std::mem::take(&mut self.channels.records)),
            (records::STATISTICS, self.statistics()),
            (records::CHUNK_INDEX, std::mem::take(&mut self.chunk_indexes)),
            (records::METADATA_INDEX, std::mem::take(&mut self.metadata_indexes)),
        ];
        let mut offsets = Vec::new();
        for (opcode, bytes) in groups.iter().filter(|(_, bytes)| !bytes.is_empty()) {
            record(&mut offsets, records::SUMMARY_OFFSET, |put| {
                put.u8(*opcode);
                put.u64(base + self.staging.len() as u64);
                put.u64(bytes.len() as u64);
            });
            self.staging.extend_from_slice(bytes);
        }
        let offsets_at = self.staging.len();
        self.staging.extend_from_slice(&offsets);
        let mut footer = alone(records::FOOTER, |put| {
            put.u64(base + begin as u64);
            put.u64(base + offsets_at as u64);
            put.u32(0);
        });
        footer.truncate(footer.len() - 4); // the checksum covers all before itself
        self.staging.extend_from_slice(&footer);
        let crc = crc32fast::hash(&self.staging[begin..]);
        self.staging.extend_from_slice(&crc.to_le_bytes());
        self.staging.extend_from_slice(records::MAGIC);
    }
}

/// The number of a definition, `next` if it is new: then it goes into the chunk.
fn define(
    definitions: &mut Definitions,
    chunk: &mut Chunk,
    next: Option<u16>,
    opcode: u8,
    put: impl FnOnce(&mut records::Put),
) -> Option<u16> {
    let mut content = Vec::new();
    put(&mut records::Put(&mut content));
    if let Some(&id) = definitions.ids.get(&content) {
        return Some(id);
    }
    let id = next?;
    let bytes = alone(opcode, |put| {
        put.u16(id);
        put.0.extend_from_slice(&content);
    });
    chunk.define(&bytes);
    definitions.records.extend_from_slice(&bytes);
    definitions.ids.insert(content, id);
    Some(id)
}
