// SPDX-License-Identifier: Apache-2.0
//! What C cannot have from a C library here, behind a C header.

mod c;
mod chunk;
mod growing_file;
mod mcap_file;
mod records;
mod writer;
