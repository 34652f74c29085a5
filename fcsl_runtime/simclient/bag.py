# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP bags: ours in every detail, others as far as their embedded schemas go; other formats: open_bag.py.

A recording that was cut off (power loss, kill -9) is read as far as it is intact; `Bag.truncated` then says so.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import mcap.records as records
import numpy as np
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from .bag_fields import field_value as field_value
from .bag_files import bag_files
from .cdr import Layout, fixed_layout
from .errors import BagError, did_you_mean
from .mcap_file import Batch, Scan, check_begin, read_summary

Array = np.ndarray[Any, Any]

#: Rows that make a stack; it has more only where one batch brings them. Bounds the memory of streaming readers.
STACK_ROWS = 4096
_SEC, _NANOSEC = "header.stamp.sec", "header.stamp.nanosec"
_OWN_PACKAGE = "fcsl_msgs/msg/"
_CHECKPOINT_SUFFIX = "/record/checkpoint"


@dataclass(frozen=True)
class Topic:
    """A topic of a bag. `count` is the number of its messages; the schema is what the bag itself embeds."""

    name: str
    type: str
    count: int
    encoding: str
    schema_encoding: str
    schema: str


@dataclass(frozen=True)
class RecordedMachine:
    """The topics of one machine in a bag of ours: `prefix` is /<namespace>/<machine>, `outputs` instance to topic, `fields`
    what other paths begin with (`nav.inputs`, `nav.state`, `channels`) to topic."""

    name: str
    prefix: str
    outputs: dict[str, str]
    fields: dict[str, str] = field(default_factory=dict)

    @property
    def checkpoint(self) -> str:
        return self.prefix + _CHECKPOINT_SUFFIX

    @property
    def writes(self) -> str:
        return self.prefix + "/record/writes"

    @property
    def state(self) -> str:
        return self.prefix + "/state"

    @property
    def topics(self) -> set[str]:
        return {self.checkpoint, self.writes, self.state, *self.outputs.values()}


class Bag:
    """One bag: a directory as ROS 2 writes it, or a single .mcap file. Raises BagError when it is neither.

    `notes` say what a user should know of how it was read.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.truncated = ""
        self.notes: list[str] = []
        self.topics: dict[str, Topic] = {}
        self._stores: dict[str, Typestore] = {}
        self._layouts: dict[str, Layout | None] = {}
        self._open()

    def _open(self) -> None:
        """Finds the files and fills `topics`."""
        self.files = bag_files(self.path)
        # Only the first must be sound: a recorder that died while it began the next file leaves that one empty.
        check_begin(self.files[0])
        for file in self.files:
            self._take_inventory(file)

    # ---- contents ------------------------------------------------------------------------------------------

    def _take_inventory(self, file: Path) -> None:
        """Fills `topics`: from the file's summary, or by reading all of it when it has none."""
        summary = read_summary(file)
        if summary is not None:
            counts = summary.statistics.channel_message_counts if summary.statistics else {}
            for number, channel in summary.channels.items():
                self._add_topic(channel, summary.schemas.get(channel.schema_id), counts.get(number, 0))
            return
        scan = Scan(file)
        counts = dict.fromkeys(scan.channels, 0)
        for number, _, _ in scan.messages(None):
            counts[number] = counts.get(number, 0) + 1
        for number, channel in scan.channels.items():
            self._add_topic(channel, scan.schemas.get(channel.schema_id), counts.get(number, 0))
        self.truncated = scan.damage or f"{file.name} was not closed after {sum(counts.values())} messages"

    def _add_topic(self, channel: records.Channel, schema: records.Schema | None, count: int) -> None:
        """Of a topic that changes its type within the bag, `topics` has the first one."""
        known = self.topics.setdefault(channel.topic, _topic(channel, schema))
        self.topics[channel.topic] = replace(known, count=known.count + count)

    def topic(self, name: str) -> Topic:
        """The topic called `name`. Raises BagError listing what is there."""
        topic = self.topics.get(name)
        if topic is None:
            listed = "".join(f"\n  {t.name} [{t.type}], {t.count} messages" for t in self.topics.values())
            hint = did_you_mean(name, self.topics)
            raise BagError(f"{self.path}: no topic `{name}`{hint}; it holds:{listed or ' nothing'}")
        return topic

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """(topic, log time in ns, CDR bytes) in the order of the file; of `topics` only, when given.

        Ends where the file is damaged, and then sets `truncated`.
        """
        for batch, announced in self.batches(topics):
            for number, log_ns, begin, end in batch.entries.tolist():
                yield announced[number].name, log_ns, batch.data[begin:end]

    def batches(self, topics: Collection[str] | None = None) -> Iterator[tuple[Batch, Mapping[int, Topic]]]:
        """What `messages` gives, many at a time, and what was announced of each number in a batch (its count is 0)."""
        for file in self.files:
            scan = Scan(file)
            announced: dict[int, Topic] = {}
            for batch in scan.batches(topics):
                for number in scan.channels.keys() - announced.keys():
                    channel = scan.channels[number]
                    announced[number] = _topic(channel, scan.schemas.get(channel.schema_id))
                yield batch, announced
            if scan.damage:
                self.truncated = scan.damage
                return

    def topic_batches(self, topics: Collection[str]) -> Iterator[tuple[str, Batch]]:
        """What `messages` gives, one topic's messages of a batch at a time, each topic's in the order of the file."""
        for batch, announced in self.batches(topics):
            numbers = batch.entries["number"]
            of: dict[str, list[int]] = {}
            for number in np.unique(numbers).tolist():
                of.setdefault(announced[number].name, []).append(number)
            for topic in [name for name in of if name in topics]:
                mine = numbers == of[topic][0] if len(of[topic]) == 1 else np.isin(numbers, of[topic])
                yield topic, Batch(batch.data, batch.entries[mine])

    # ---- decoding ------------------------------------------------------------------------------------------

    def store(self, topic: str) -> Typestore:
        """The types that the bag embeds for `topic`. Raises BagError when it has none that can be read."""
        store = self._stores.get(topic)
        if store is None:
            info = self.topic(topic)
            if info.encoding != "cdr" or info.schema_encoding not in ("ros2msg", "ros2idl"):
                raise BagError(
                    f"{self.path}: topic `{topic}` is {info.encoding or 'raw'} with a "
                    f"{info.schema_encoding or 'missing'} schema; ROS 2 messages (cdr, ros2msg) are wanted"
                )
            store = get_typestore(Stores.EMPTY)
            try:
                parse = get_types_from_idl if info.schema_encoding == "ros2idl" else None
                store.register(parse(info.schema) if parse else get_types_from_msg(info.schema, info.type))
            except Exception as error:  # noqa: BLE001  damaged text can make the parser below raise anything
                raise BagError(f"{self.path}: the schema of `{topic}` is not valid: {error}") from None
            self._stores[topic] = store
        return store

    def decode(self, topic: str, data: bytes) -> Any:
        """The message as an object with the fields of its definition. Raises BagError."""
        try:
            return self.store(topic).deserialize_cdr(data, self.topic(topic).type)
        except BagError:
            raise
        except Exception as error:  # noqa: BLE001  damaged bytes can make the decoder raise anything
            raise BagError(f"{self.path}: a message of `{topic}` does not match its schema: {error}") from None

    def decode_own(self, topic: str, data: bytes, fields: Collection[str]) -> Any:
        """`decode` for the messages that we define: raises BagError too when one of `fields` is not in the schema."""
        message = self.decode(topic, data)
        missing = [name for name in fields if not hasattr(message, name)]
        if missing:
            raise BagError(
                f"{self.path}: topic `{topic}` [{self.topic(topic).type}] has no field `{missing[0]}`; "
                "the recording is damaged or another program made it"
            )
        return message

    def layout(self, topic: str) -> Layout | None:
        """The fixed layout of the messages of `topic`, or None. Raises BagError when its schema is not valid."""
        if topic not in self._layouts:
            store = self.store(topic)
            try:
                self._layouts[topic] = fixed_layout(store.fielddefs, self.topic(topic).type)
            except Exception as error:  # noqa: BLE001  a damaged schema may lack types, repeat names or contain itself
                raise BagError(f"{self.path}: the schema of `{topic}` is not valid: {error}") from None
        return self._layouts[topic]

    def fixed_layout(self, topic: str) -> Layout:
        """The layout of the messages of `topic`. Raises BagError when it is not fixed."""
        layout = self.layout(topic)
        if layout is None:
            raise BagError(f"{self.path}: topic `{topic}` [{self.topic(topic).type}] has no fixed layout")
        return layout

    def rows(self, topic: str, batch: Batch) -> Array:
        """The messages of a batch, all of `topic`, as rows of its fixed layout. Raises BagError when one is not."""
        fits, rows = self.fixed_layout(topic).read(batch.data, batch.entries)
        if not fits.all():
            _, _, begin, end = batch.entries[fits.argmin()].tolist()
            raise BagError(f"{self.path}: a message of `{topic}` ({end - begin} bytes) does not match its schema")
        return rows

    # ---- machines ------------------------------------------------------------------------------------------

    def machines(self) -> list[RecordedMachine]:
        """The machines that this bag records; none in a bag that we did not make."""
        found = []
        for name in self.topics:
            if not name.endswith(_CHECKPOINT_SUFFIX):
                continue
            prefix = name.removesuffix(_CHECKPOINT_SUFFIX)
            outputs = {
                topic.name.removeprefix(prefix + "/"): topic.name
                for topic in self.topics.values()
                if topic.name.startswith(prefix + "/")
                and "/" not in topic.name.removeprefix(prefix + "/")
                and not topic.type.startswith(_OWN_PACKAGE)
            }
            fields = {
                ".".join(topic.name.removeprefix(prefix + "/record/").removeprefix(prefix + "/").split("/")): topic.name
                for topic in self.topics.values()
                if topic.name.startswith(prefix + "/")
                and is_made_for_a_record(topic)
                and topic.name not in outputs.values()
            }
            found.append(RecordedMachine(prefix.rsplit("/", 1)[-1], prefix, outputs, fields))
        return found

    def machine(self, wanted: str = "") -> RecordedMachine:
        """The machine named `wanted` (or its topic prefix), or the only one. Raises BagError."""
        machines = self.machines()
        if not machines and self.truncated:
            raise BagError(f"{self.path}: damaged or cut off before the first record of a machine ({self.truncated})")
        if not machines:
            raise BagError(
                f"{self.path}: not a recording of a machine (no topic */record/checkpoint); "
                "to run a machine on a bag that FCSL did not record, use simclient.replay with --map"
            )
        chosen = [m for m in machines if not wanted or wanted in (m.name, m.prefix)]
        if len(chosen) != 1:
            names = ", ".join(m.prefix for m in machines)
            raise BagError(
                f"{self.path}: "
                + (f"no machine `{wanted}`" if not chosen else "several machines")
                + f"; it holds {names}"
            )
        return chosen[0]


def is_made_for_a_record(topic: Topic) -> bool:
    """Whether its type is no interface of ROS 2 but one that the recorder made for the fields that were chosen."""
    return topic.type.partition("/")[0].endswith("_fields")


def _topic(channel: records.Channel, schema: records.Schema | None) -> Topic:
    return Topic(
        name=channel.topic,
        type=schema.name if schema else "",
        count=0,
        encoding=channel.message_encoding,
        schema_encoding=schema.encoding if schema else "",
        schema=schema.data.decode("utf-8", "replace") if schema else "",
    )


def stacks(bag: Bag, topics: Collection[str]) -> Iterator[tuple[str, Array]]:
    """(topic, rows) for topics with a fixed layout, some STACK_ROWS rows at a time, each topic's in file order.

    Memory stays bounded however long the bag is. Raises BagError for a topic whose messages differ in layout.
    """
    pending: dict[str, list[Array]] = {topic: [] for topic in topics}
    counts = dict.fromkeys(topics, 0)
    for topic in topics:
        bag.fixed_layout(topic)
    for topic, batch in bag.topic_batches(topics):
        rows = bag.rows(topic, batch)
        pending[topic].append(rows)
        counts[topic] += len(rows)
        if counts[topic] >= STACK_ROWS:
            yield topic, np.concatenate(pending[topic])
            pending[topic], counts[topic] = [], 0
    for topic, parts in pending.items():
        if parts:
            yield topic, np.concatenate(parts)


def rows_of(bag: Bag, topic: str) -> Array:
    """Every message of a topic with a fixed layout, one row each; columns are named by field path."""
    parts = [rows for _, rows in stacks(bag, [topic])]
    return np.concatenate(parts) if parts else np.empty(0, bag.fixed_layout(topic).dtype)


def has_stamps(layout: Layout) -> bool:
    """Whether the messages begin with a header, so that `stamps_s` can read them."""
    return {_SEC, _NANOSEC} <= layout.leaves.keys()


def stamps_s(rows: Array) -> Array:
    """Header stamps in seconds, float64 of shape (N,)."""
    seconds: Array = rows[_SEC].astype(np.float64) + rows[_NANOSEC].astype(np.float64) * 1e-9
    return seconds


def columns(bag: Bag | str, path: str, machine: str = "") -> tuple[Array, Array]:
    """(t_s, values) of one output, state or message field over a whole bag.

    `path` is `<instance>.outputs.<field>`, `machine.state`, `machine.next_state`, or `<topic>:<field path>` of any.
    t_s is float64 of shape (N,), seconds of the header stamp (of the log time, where there is no header). Values are of
    shape (N,) or (N, count), arrays of more dimensions flattened row-major; states are strings. `machine` chooses among
    several in one bag. Raises BagError naming what is there when the path is not.
    """
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    topic, field = _locate(opened, path, machine)
    layout = opened.layout(topic)
    if layout is None or field not in layout.leaves or not _all_fit(opened, topic):
        return _slow_columns(opened, topic, field)
    rows = rows_of(opened, topic)
    values: Array = rows[field]
    if layout.leaves[field].ros_type == "bool":
        values = values.astype(bool)
    if has_stamps(layout):
        return stamps_s(rows), values
    return _log_times(opened, topic), values


def _locate(bag: Bag, path: str, machine: str) -> tuple[str, str]:
    """Topic and message field of a path."""
    if path.startswith("/"):
        topic, _, field = path.rpartition(":")
        if not topic:
            raise BagError(f"`{path}`: write <topic>:<field path>")
        bag.topic(topic)
        return topic, field
    recorded = bag.machine(machine)
    if path in ("machine.state", "machine.next_state"):
        return recorded.state, path.removeprefix("machine.")
    for begin, topic in recorded.fields.items():
        if path.startswith(begin + "."):
            return topic, path.removeprefix(begin + ".")
    instance, _, field = path.partition(".outputs.")
    if not field:
        known = ", ".join(sorted(recorded.fields))
        raise BagError(
            f"`{path}`: recorded are machine.state, outputs (write <instance>.outputs.<field>)"
            + (f", and what begins with {known}" if known else "")
        )
    if instance not in recorded.outputs:
        raise BagError(
            f"{bag.path}: `{path}`: no instance `{instance}`; it holds {', '.join(sorted(recorded.outputs))}"
        )
    return recorded.outputs[instance], field


def _all_fit(bag: Bag, topic: str) -> bool:
    layout = bag.layout(topic)
    return layout is not None and all(
        layout.read(data, entries)[0].all() for _, (data, entries) in bag.topic_batches({topic})
    )


def _log_times(bag: Bag, topic: str) -> Array:
    parts = [entries["log_ns"] * 1e-9 for _, (_, entries) in bag.topic_batches({topic})]
    return np.concatenate(parts) if parts else np.empty(0)


def _slow_columns(bag: Bag, topic: str, field: str) -> tuple[Array, Array]:
    """Message by message, for types of variable layout."""
    times, values = [], []
    for _, log_time, data in bag.messages({topic}):
        message = bag.decode(topic, data)
        header = getattr(message, "header", None)
        times.append(log_time * 1e-9 if header is None else header.stamp.sec + header.stamp.nanosec * 1e-9)
        values.append(field_value(bag.topic(topic), message, field))
    return np.array(times, dtype=np.float64), np.array(values)


if __name__ == "__main__":
    from .bag_cli import main
    from .cli import run_tool

    run_tool("simclient.bag", main)
