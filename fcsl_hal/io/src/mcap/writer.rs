// SPDX-License-Identifier: Apache-2.0
//! One MCAP file: definitions, chunks, and at the end the summary.

use std::collections::{BTreeMap, HashMap};
use std::fs::File;
use std::io;

use super::chunk::Chunk;
use super::chunk_file::ChunkFile;
use super::packer::Packer;
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
    /// None while the packer has it.
    file: Option<Box<ChunkFile>>,
    chunk: Chunk,
    /// The next one to gather in; None while the packer has it.
    spare: Option<Chunk>,
    /// Has the file and a chunk.
    packer: Option<Packer>,
    schemas: Definitions,
    channels: Definitions,
    message_counts: Vec<u64>,
    metadata_indexes: Vec<u8>,
    metadata_count: u32,
    /// Of all messages; none yet: None.
    bounds_ns: Option<(u64, u64)>,
}

impl Writer {
    pub fn new(file: File, profile: &str, library: &str) -> io::Result<Self> {
        let mut file = Box::new(ChunkFile::new(file));
        file.staging.extend_from_slice(records::MAGIC);
        record(&mut file.staging, records::HEADER, |put| {
            put.string(profile);
            put.string(library);
        });
        file.put_staging();
        file.file.flush()?; // a recording from the start, if an empty one
        Ok(Self {
            file: Some(file),
            chunk: Chunk::new()?,
            spare: Some(Chunk::new()?),
            packer: None,
            schemas: Definitions::default(),
            channels: Definitions::default(),
            message_counts: Vec::new(),
            metadata_indexes: Vec::new(),
            metadata_count: 0,
            bounds_ns: None,
        })
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
            self.hand_over()?;
        }
        Ok(true)
    }

    pub fn add_metadata(&mut self, name: &str, metadata: &BTreeMap<String, String>) -> io::Result<()> {
        self.flush()?;
        let file = self.file()?;
        let begin = file.file.position();
        record(&mut file.staging, records::METADATA, |put| {
            put.string(name);
            put.strings(metadata);
        });
        let length = file.staging.len() as u64;
        file.put_staging();
        file.file.flush()?;
        record(&mut self.metadata_indexes, records::METADATA_INDEX, |put| {
            put.u64(begin);
            put.u64(length);
            put.string(name);
        });
        self.metadata_count += 1;
        Ok(())
    }

    /// Ends the chunk and hands all to the operating system.
    pub fn flush(&mut self) -> io::Result<()> {
        self.file()?;
        let Self { file: Some(file), chunk, .. } = self else { return Err(lost()) };
        file.put(chunk)
    }

    /// Writes the summary; `durable`: waits until the disk has all of it.
    pub fn finish(mut self, durable: bool) -> io::Result<()> {
        self.flush()?;
        self.file()?;
        let mut file = self.file.take().ok_or_else(lost)?;
        let crc = file.data_crc();
        file.staging.extend_from_slice(&alone(records::DATA_END, |put| put.u32(crc)));
        self.put_summary(&mut file);
        file.put_staging();
        file.file.flush()?;
        let complete = file.file.into_complete()?;
        if durable {
            complete.sync_all()?;
        }
        Ok(())
    }

    /// The file, once the packer is done with the chunk that it has.
    fn file(&mut self) -> io::Result<&mut ChunkFile> {
        if let Some(packer) = self.packer.take() {
            let parcel = packer.wait().ok_or_else(lost)?;
            self.file = Some(parcel.file);
            self.spare = Some(parcel.chunk);
            parcel.put?;
        }
        self.file.as_deref_mut().ok_or_else(lost)
    }

    /// The chunk is full: gathers in the other one while the packer puts this one into the file.
    fn hand_over(&mut self) -> io::Result<()> {
        self.file()?;
        let full = std::mem::replace(&mut self.chunk, self.spare.take().ok_or_else(lost)?);
        self.packer = Some(Packer::begin(self.file.take().ok_or_else(lost)?, full));
        Ok(())
    }

    fn statistics(&self, chunk_count: u32) -> Vec<u8> {
        let (first_ns, last_ns) = self.bounds_ns.unwrap_or((0, 0));
        let counts: Vec<_> = (0u16..).zip(self.message_counts.iter().copied()).filter(|&(_, n)| n > 0).collect();
        alone(records::STATISTICS, |put| {
            put.u64(self.message_counts.iter().sum());
            put.u16(self.schemas.ids.len() as u16);
            put.u32(self.channels.ids.len() as u32);
            put.u32(0);
            put.u32(self.metadata_count);
            put.u32(chunk_count);
            put.u64(first_ns);
            put.u64(last_ns);
            put.numbers(counts.into_iter());
        })
    }

    /// Appends summary, its offsets, footer and magic to what is staged.
    fn put_summary(&mut self, file: &mut ChunkFile) {
        let base = file.file.position();
        let begin = file.staging.len();
        let groups = [
            (records::SCHEMA, std::mem::take(&mut self.schemas.records)),
            (records::CHANNEL, std::mem::take(&mut self.channels.records)),
            (records::STATISTICS, self.statistics(file.count)),
            (records::CHUNK_INDEX, std::mem::take(&mut file.indexes)),
            (records::METADATA_INDEX, std::mem::take(&mut self.metadata_indexes)),
        ];
        let mut offsets = Vec::new();
        for (opcode, bytes) in groups.iter().filter(|(_, bytes)| !bytes.is_empty()) {
            record(&mut offsets, records::SUMMARY_OFFSET, |put| {
                put.u8(*opcode);
                put.u64(base + file.staging.len() as u64);
                put.u64(bytes.len() as u64);
            });
            file.staging.extend_from_slice(bytes);
        }
        let offsets_at = file.staging.len();
        file.staging.extend_from_slice(&offsets);
        let mut footer = alone(records::FOOTER, |put| {
            put.u64(base + begin as u64);
            put.u64(base + offsets_at as u64);
            put.u32(0);
        });
        footer.truncate(footer.len() - 4); // the checksum covers all before itself
        file.staging.extend_from_slice(&footer);
        let crc = crc32fast::hash(&file.staging[begin..]);
        file.staging.extend_from_slice(&crc.to_le_bytes());
        file.staging.extend_from_slice(records::MAGIC);
    }
}

/// The packer's thread is gone, which no call explains.
fn lost() -> io::Error {
    io::Error::other("the thread that compresses has ended")
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
