# SPDX-License-Identifier: Apache-2.0
"""Gives a bag of MCAP files, whose recorder was killed or whose bytes are damaged, an end and a metadata.yaml again.

Messages are left where they are. A part that cannot be read becomes a private record, which readers pass over; behind the
last whole record comes a new summary. Whatever moment this is stopped at, doing it again finishes it.
"""

from __future__ import annotations

import fcntl
import os
import zlib
from collections.abc import Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, BinaryIO

import mcap.records as records
import numpy as np
import yaml
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode

from ..complete_output import complete_or_absent
from ..errors import BagError
from .files import mcap_files, metadata_of
from .mcap_file import Scan, check_begin, read_summary
from .mcap_walk import CHUNK_HEAD, LOST, LOST_MARK, MAGIC, RECORD_HEAD, Record, Walk


@dataclass
class _File:
    """What a file holds, as its new summary and metadata.yaml tell it. `rewritten`: it was not in order."""

    path: Path
    channels: dict[int, records.Channel]
    schemas: dict[int, records.Schema]
    counts: dict[int, int] = field(default_factory=dict)
    first_ns: int = 0
    last_ns: int = 0
    missing: str = ""
    rewritten: bool = False

    @property
    def messages(self) -> int:
        return sum(self.counts.values())


def repair(path: str | Path) -> tuple[str, str]:
    """(what was done, what is missing) of the bag at `path`, which is a directory, or one .mcap file of its own.

    Raises BagError for what is no bag of MCAP files, or is being recorded.
    """
    where = Path(path)
    files = [where] if where.is_file() else mcap_files(where)
    done = []
    for file in files:
        check_begin(file)
        with file.open("r+b") as stream:
            _lock(file, stream)
            done.append(_repaired(file, stream))
    lines = [f"{f.path.name}: {f.messages} messages, {'end rewritten' if f.rewritten else 'in order'}" for f in done]
    if where.is_dir():
        _write_metadata(where, done)
        lines.append(f"metadata.yaml: {sum(f.messages for f in done)} messages")
    return "\n".join(lines), "; ".join(f.missing for f in done if f.missing)


def _lock(file: Path, stream: BinaryIO) -> None:
    """FCSL's recorder holds a lock on the file that it writes."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        raise BagError(f"{file}: it is being recorded; end the recording first") from None
    except OSError:
        return  # a file system without locks


def _repaired(file: Path, stream: BinaryIO) -> _File:
    known = read_summary(file)
    found, scan = _survey(file, known)
    if known is not None and not scan.damage and found.messages == known.statistics.message_count:
        return found
    for loss in scan.parts:
        _pass_over(file, stream, loss.begin, loss.end)
    missing = scan.damage
    found, _ = _survey(file, known)
    found.missing, found.rewritten = missing, True
    end = _rewrite_end(stream, found)
    stream.truncate(end)
    stream.flush()
    os.fsync(stream.fileno())
    return found


def _survey(file: Path, known: Any) -> tuple[_File, Scan]:
    """What a pass over the file finds."""
    scan = Scan(file, known)
    found = _File(file, scan.channels, scan.schemas)
    for batch in scan.batches(None):
        if not len(batch.entries):
            continue
        times = batch.entries["log_ns"]
        first, last = int(times.min()), int(times.max())
        found.first_ns = min(found.first_ns, first) if found.counts else first
        found.last_ns = max(found.last_ns, last) if found.counts else last
        for number, count in zip(*np.unique(batch.entries["number"], return_counts=True), strict=True):
            found.counts[int(number)] = found.counts.get(int(number), 0) + int(count)
    return found, scan


def _pass_over(file: Path, stream: BinaryIO, begin: int, end: int) -> None:
    """Makes a private record of a part that cannot be read; `info` and the like go on telling of it."""
    length = end - begin - RECORD_HEAD.size
    if length < len(LOST_MARK):
        raise BagError(f"{file}: the damage at byte {begin} is too short to be passed over; `cut` makes a clean copy")
    stream.seek(end - len(LOST_MARK))
    stream.write(LOST_MARK)
    stream.seek(begin)
    stream.write(RECORD_HEAD.pack(LOST, length))
    stream.flush()


def _rewrite_end(stream: BinaryIO, found: _File) -> int:
    """Writes all from the end of the data section on; returns where the file then ends."""
    chunks, walk = _chunk_indexes(stream)
    data_end = RecordBuilder()
    records.DataEnd(data_section_crc=0).write(data_end)
    begin = walk.end + data_end.count
    summary = RecordBuilder()
    for definition in (*found.schemas.values(), *found.channels.values()):
        definition.write(summary)
    records.Statistics(
        attachment_count=0,
        channel_count=len(found.channels),
        channel_message_counts=found.counts,
        chunk_count=len(chunks),
        message_count=found.messages,
        message_end_time=found.last_ns,
        message_start_time=found.first_ns,
        metadata_count=0,
        schema_count=len(found.schemas),
    ).write(summary)
    for chunk in chunks:
        chunk.write(summary)
    footer = RECORD_HEAD.pack(Opcode.FOOTER, 20) + begin.to_bytes(8, "little") + bytes(8)
    content = summary.end() + footer
    stream.seek(walk.end)
    stream.write(data_end.end() + content + zlib.crc32(content).to_bytes(4, "little") + MAGIC)
    return stream.tell()


def _chunk_indexes(stream: BinaryIO) -> tuple[list[records.ChunkIndex], Walk]:
    found: list[records.ChunkIndex] = []
    walk = Walk(stream)
    for part in walk:
        if not isinstance(part, Record):
            continue
        if part.opcode == Opcode.CHUNK:
            found.append(_chunk_index(stream, part))
        elif part.opcode == Opcode.MESSAGE_INDEX and found and _follows(found[-1], part):
            stream.seek(part.content)
            found[-1].message_index_offsets[int.from_bytes(stream.read(2), "little")] = part.begin
            found[-1].message_index_length += part.end - part.begin
    return found, walk


def _follows(chunk: records.ChunkIndex, part: Record) -> bool:
    """Whether an index is one of this chunk: they follow it without anything between."""
    return chunk.chunk_start_offset + chunk.chunk_length + chunk.message_index_length == part.begin


def _chunk_index(stream: BinaryIO, part: Record) -> records.ChunkIndex:
    stream.seek(part.content)
    head = stream.read(CHUNK_HEAD.size)
    first, last, size, _, name_bytes = CHUNK_HEAD.unpack(head)
    compression = stream.read(name_bytes).decode()
    return records.ChunkIndex(
        chunk_length=part.end - part.begin,
        chunk_start_offset=part.begin,
        compression=compression,
        compressed_size=int.from_bytes(stream.read(8), "little"),
        message_end_time=last,
        message_index_length=0,
        message_index_offsets={},
        message_start_time=first,
        uncompressed_size=size,
    )


def _write_metadata(folder: Path, files: Iterable[_File]) -> None:
    """metadata.yaml in the form of Jazzy; what only the old one can know is taken from it."""
    old = metadata_of(folder)
    every = list(files)
    spans = [(f.first_ns, f.last_ns) for f in every if f.messages]
    begin, end = (min(s[0] for s in spans), max(s[1] for s in spans)) if spans else (0, 0)
    information = {
        "version": 9,
        "storage_identifier": "mcap",
        "duration": {"nanoseconds": end - begin},
        "starting_time": {"nanoseconds_since_epoch": begin},
        "message_count": sum(f.messages for f in every),
        "topics_with_message_count": _topics(every),
        "compression_format": _text(old, "compression_format", ""),
        "compression_mode": _text(old, "compression_mode", ""),
        "relative_file_paths": [f.path.name for f in every],
        "files": [
            {
                "path": f.path.name,
                "starting_time": {"nanoseconds_since_epoch": f.first_ns},
                "duration": {"nanoseconds": f.last_ns - f.first_ns},
                "message_count": f.messages,
            }
            for f in every
        ],
        "custom_data": None,
        "ros_distro": _text(old, "ros_distro", "jazzy"),
    }
    with complete_or_absent(folder / "metadata.yaml") as partial:
        partial.write_text(yaml.safe_dump({"rosbag2_bagfile_information": information}, sort_keys=False))


def _text(old: Any, key: str, otherwise: str) -> str:
    value = old.get(key)
    return value if isinstance(value, str) else otherwise


def _topics(files: Iterable[_File]) -> list[dict[str, Any]]:
    found: dict[str, dict[str, Any]] = {}
    for file in files:
        for number, channel in file.channels.items():
            schema = file.schemas.get(channel.schema_id)
            entry = found.setdefault(
                channel.topic,
                {
                    "topic_metadata": {
                        "name": channel.topic,
                        "type": schema.name if schema else "",
                        "serialization_format": channel.message_encoding,
                        "offered_qos_profiles": _qos(channel),
                        "type_description_hash": channel.metadata.get("topic_type_hash", ""),
                    },
                    "message_count": 0,
                },
            )
            entry["message_count"] += file.counts.get(number, 0)
    return list(found.values())


def _qos(channel: records.Channel) -> list[Any]:
    """The qualities of service that the recorder noted at the topic; none if it noted none that can be read."""
    try:
        profiles = yaml.safe_load(channel.metadata.get("offered_qos_profiles", ""))
    except (yaml.YAMLError, ValueError, RecursionError):
        return []
    return profiles if isinstance(profiles, list) else []
