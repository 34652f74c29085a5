// SPDX-License-Identifier: Apache-2.0
// Reads a bag as Foxglove does (its own packages) and prints every message: one line of JSON, [topic, log time, message].
//
//     node read.js BAG.mcap
//
// Numbers that JSON cannot hold are texts: NaN, Infinity, -Infinity, -0, and whole numbers of 64 bits.
import { parse } from "@foxglove/rosmsg";
import { MessageReader } from "@foxglove/rosmsg2-serialization";
import { McapIndexedReader } from "@mcap/core";
import { open } from "node:fs/promises";
import { zstdDecompressSync } from "node:zlib";

const file = await open(process.argv[2]);
const readable = {
  size: async () => BigInt((await file.stat()).size),
  read: async (offset, length) => {
    const bytes = new Uint8Array(Number(length));
    const { bytesRead } = await file.read(bytes, 0, bytes.length, Number(offset));
    if (bytesRead !== bytes.length) throw new Error(`${bytes.length} bytes at ${offset}: the file is shorter`);
    return bytes;
  },
};
const decompressHandlers = { zstd: (bytes) => zstdDecompressSync(bytes) };

function exact(_, value) {
  if (typeof value === "bigint") return value.toString();
  if (ArrayBuffer.isView(value)) return Array.from(value);
  if (typeof value === "number" && (!Number.isFinite(value) || Object.is(value, -0))) return Object.is(value, -0) ? "-0" : `${value}`;
  return value;
}

const bag = await McapIndexedReader.Initialize({ readable, decompressHandlers });
const readers = new Map();
for await (const message of bag.readMessages()) {
  const channel = bag.channelsById.get(message.channelId);
  if (!readers.has(channel.id)) {
    const text = new TextDecoder().decode(bag.schemasById.get(channel.schemaId).data);
    readers.set(channel.id, new MessageReader(parse(text, { ros2: true })));
  }
  const content = readers.get(channel.id).readMessage(message.data);
  process.stdout.write(`${JSON.stringify([channel.topic, message.logTime, content], exact)}\n`);
}
