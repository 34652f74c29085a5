# SPDX-License-Identifier: Apache-2.0
"""Writes messages unchanged into a new bag in Jazzy's layout: metadata.yaml and one .mcap file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from rosbags.interfaces import Connection, Qos
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.metadata import parse_qos

from ..complete_output import check_target, complete_or_absent
from ..errors import BagError
from .bag import Bag, Topic

#: The format version of metadata.yaml that Jazzy writes. rosbags decides the size of chunks.
_FORMAT = 9


class Copy:
    """An open bag that takes messages of another bag's topics."""

    def __init__(self, writer: Writer, connections: Mapping[str, Connection]):
        self._writer = writer
        self._connections = connections
        self.messages = 0

    def write(self, topic: str, log_ns: int, data: bytes) -> None:
        self._writer.write(self._connections[topic], log_ns, data)
        self.messages += 1


def can_be_copied(topic: Topic) -> bool:
    """Whether it has ROS 2 messages with their definition."""
    return topic.encoding == "cdr" and topic.schema_encoding in ("ros2msg", "ros2idl")


@contextmanager
def copy_of(bag: Bag, target: str | Path, topics: Iterable[str]) -> Iterator[Copy]:
    """A new bag at `target` with `topics` of `bag`; complete if the block succeeds, absent if it fails.

    Definitions, type hashes and offered qualities of service are those of `bag`. Raises BagError.
    """
    check_target(target, is_new=True)
    offered = _offered(bag)
    with complete_or_absent(target) as partial:
        with Writer(partial, version=_FORMAT, storage_plugin=StoragePlugin.MCAP) as writer:
            connections = {}
            for name in topics:
                topic = bag.topic(name)
                qos, type_hash = offered.get(name, ((), ""))
                connections[name] = writer.add_connection(
                    name,
                    topic.type,
                    msgdef=topic.schema,
                    rihs01=type_hash or _type_hash(bag, topic),
                    offered_qos_profiles=qos,
                )
            yield Copy(writer, connections)


def _type_hash(bag: Bag, topic: Topic) -> str:
    try:
        return bag.store(topic.name).hash_rihs01(topic.type)
    except BagError:
        raise
    except Exception as error:  # noqa: BLE001  a damaged definition can make rosbags raise anything
        raise BagError(f"{bag.path}: the schema of `{topic.name}` is not valid: {error}") from None


def _offered(bag: Bag) -> dict[str, tuple[tuple[Qos, ...], str]]:
    """Topic to offered qualities of service and type hash, empty if metadata.yaml cannot be read."""
    found: dict[str, tuple[tuple[Qos, ...], str]] = {}
    try:
        text = (bag.path / "metadata.yaml").read_text()
        listed: Any = yaml.safe_load(text)["rosbag2_bagfile_information"]["topics_with_message_count"]
        for entry in listed:
            metadata = entry["topic_metadata"]
            qos = tuple(parse_qos(metadata["offered_qos_profiles"]))
            found[metadata["name"]] = qos, str(metadata["type_description_hash"] or "")
    except Exception:  # noqa: BLE001  it tells nothing that a copy cannot do without, and damage can make it anything
        return found
    return found
