// SPDX-License-Identifier: Apache-2.0
//! What is in the file, and what its summary will say of the chunks in it.

use std::fs::File;
use std::io;

use super::chunk::{Chunk, Sealed};
use super::growing_file::GrowingFile;
use super::records::{self, record};

pub struct ChunkFile {
    pub file: GrowingFile,
    data_crc: crc32fast::Hasher,
    /// What goes to the file next.
    pub staging: Vec<u8>,
    pub indexes: Vec<u8>,
    pub count: u32,
}

impl ChunkFile {
    pub fn new(file: File) -> Self {
        Self {
            file: GrowingFile::new(file),
            data_crc: crc32fast::Hasher::new(),
            staging: Vec::new(),
            indexes: Vec::new(),
            count: 0,
        }
    }

    pub fn put_staging(&mut self) {
        self.data_crc.update(&self.staging);
        self.file.write(&self.staging);
        self.staging.clear();
    }

    /// The checksum of all that was put.
    pub fn data_crc(&self) -> u32 {
        self.data_crc.clone().finalize()
    }

    /// Puts what was gathered, if there is anything, and hands all to the operating system. The chunk is empty afterwards.
    pub fn put(&mut self, chunk: &mut Chunk) -> io::Result<()> {
        if chunk.bytes() > 0 {
            let sealed = chunk.seal(&mut self.staging)?;
            self.index(&sealed);
            self.put_staging();
        }
        self.file.flush()
    }

    fn index(&mut self, sealed: &Sealed) {
        let begin = self.file.position();
        self.count += 1;
        record(&mut self.indexes, records::CHUNK_INDEX, |put| {
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
}
