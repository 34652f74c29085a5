// SPDX-License-Identifier: Apache-2.0
//! A thread that puts one chunk into the file while the next one is gathered. It ends with the chunk: what it has done is
//! known by waiting for its end, which tools that watch threads see.

use std::io;
use std::sync::{Arc, Mutex};
use std::thread::{self, JoinHandle};

use super::chunk::Chunk;
use super::chunk_file::ChunkFile;

/// The file goes along, so that only one thread has it.
pub struct Parcel {
    pub file: Box<ChunkFile>,
    pub chunk: Chunk,
    /// Whether it succeeded.
    pub put: io::Result<()>,
}

/// One chunk on its way.
pub struct Packer {
    parcel: Arc<Mutex<Parcel>>,
    thread: Thread,
}

impl Packer {
    /// Begins to put `chunk` into `file`; puts it there if no thread can be started. The thread blocks the signals that
    /// the caller blocks.
    pub fn begin(file: Box<ChunkFile>, chunk: Chunk) -> Self {
        let parcel = Arc::new(Mutex::new(Parcel { file, chunk, put: Ok(()) }));
        let theirs = Arc::clone(&parcel);
        let thread = thread::Builder::new().name("fcsl-pack".into()).spawn(move || pack(&theirs)).ok();
        if thread.is_none() {
            pack(&parcel);
        }
        Self { parcel, thread: Thread(thread) }
    }

    /// The file, and an empty chunk. None: the thread has failed in a way that no call explains.
    pub fn wait(self) -> Option<Parcel> {
        drop(self.thread);
        Arc::into_inner(self.parcel)?.into_inner().ok()
    }
}

fn pack(parcel: &Mutex<Parcel>) {
    if let Ok(mut parcel) = parcel.lock() {
        let Parcel { file, chunk, put } = &mut *parcel;
        *put = file.put(chunk);
    }
}

/// Whoever drops it waits for its end, so that nothing is written once a recording is closed.
struct Thread(Option<JoinHandle<()>>);

impl Drop for Thread {
    fn drop(&mut self) {
        if let Some(thread) = self.0.take() {
            let _ = thread.join();
        }
    }
}
