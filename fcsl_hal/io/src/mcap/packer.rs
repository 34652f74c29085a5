// SPDX-License-Identifier: Apache-2.0
//! A thread that puts one chunk into the file while the next one is gathered. It begins with the first chunk that is full:
//! short recordings have none.

use std::io;
use std::sync::mpsc::{channel, Receiver, Sender};
use std::thread::{self, JoinHandle};

use super::chunk::Chunk;
use super::chunk_file::ChunkFile;

/// The file goes along, so that only one thread has it.
struct Parcel {
    file: Box<ChunkFile>,
    chunk: Chunk,
    put: io::Result<()>,
}

pub struct Packer {
    /// None once the packer is being dropped.
    to: Option<Sender<Parcel>>,
    from: Receiver<Parcel>,
    thread: Option<JoinHandle<()>>,
}

impl Packer {
    /// The thread ends with the packer. It blocks the signals that its maker blocks.
    pub fn new() -> io::Result<Self> {
        let (to, parcels) = channel::<Parcel>();
        let (back, from) = channel();
        let thread = thread::Builder::new().name("fcsl-pack".into()).spawn(move || {
            while let Ok(mut parcel) = parcels.recv() {
                parcel.put = parcel.file.put(&mut parcel.chunk);
                if back.send(parcel).is_err() {
                    break;
                }
            }
        })?;
        Ok(Self { to: Some(to), from, thread: Some(thread) })
    }

    /// Begins to put `chunk` into `file`; `wait` follows before the next one.
    pub fn put(&self, file: Box<ChunkFile>, chunk: Chunk) {
        if let Some(to) = &self.to {
            // The thread receives for as long as there is the packer.
            let _ = to.send(Parcel { file, chunk, put: Ok(()) });
        }
    }

    /// The file, an empty chunk, and whether the putting succeeded.
    pub fn wait(&self) -> Option<(Box<ChunkFile>, Chunk, io::Result<()>)> {
        self.from.recv().ok().map(|parcel| (parcel.file, parcel.chunk, parcel.put))
    }
}

impl Drop for Packer {
    /// Waits for the thread, so that nothing is written once a recording is closed.
    fn drop(&mut self) {
        self.to = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
