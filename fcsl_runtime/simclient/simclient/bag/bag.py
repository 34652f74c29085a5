# SPDX-License-Identifier: Apache-2.0
"""Reads MCAP bags: FCSL's recordings completely, other bags as their embedded schemas allow. formats.py: other formats.

A recording that is damaged or was cut off (power loss, kill -9) is read as far as it can be, behind the damage, too;
`Bag.truncated` then says what is missing.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import mcap.records as records
import numpy as np
from rosbags.typesys import Stores, get_types_from_idl, get_types_from_msg, get_typestore
from rosbags.typesys.store import Typestore

from ..cli import Progress
from ..errors import BagError, did_you_mean
from ..ros.cdr import Layout, fixed_layout
from .batch import Batch
from .files import bag_files
from .mcap_file import BARE_END_BYTES, Scan, check_begin, read_summary
from .time_order import Block, Part, in_time_order

Array = np.ndarray[Any, Any]

_OWN_PACKAGE = "fcsl_msgs/msg/"
_CHECKPOINT_SUFFIX = "/record/checkpoint"
#: A bystander has the machine's channels in it (docs/reference/transports.md).
_DESCRIPTOR_SUFFIX = "/record/descriptor"
#: End of the topic that says what plots and viewers show of a machine. It is no part of what the machine did.
VIEWS_SUFFIX = "/record/views"
#: FCSL_VIEWS_BYTES_MAX of fcsl_machine.h, with encapsulation, length and terminating zero.
_VIEWS_MESSAGE_BYTES_MAX = 65_535 + 9


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
    """The topics of one machine in a bag that FCSL recorded. `prefix` is /<namespace>/<machine>.

    `outputs` maps an instance to its topic. `fields` maps the first parts of other paths (`nav.inputs`, `nav.state`,
    `channels`) to their topic.
    """

    name: str
    prefix: str
    outputs: dict[str, str]
    fields: dict[str, str] = field(default_factory=dict)
    #: A bystander on the bus recorded it: the values of its channels, instead of outputs and states.
    by_bystander: bool = False

    @property
    def checkpoint(self) -> str:
        return self.prefix + _CHECKPOINT_SUFFIX

    @property
    def writes(self) -> str:
        return self.prefix + "/record/writes"

    @property
    def lacks(self) -> str:
        """Of a bystander: the topic that says why the run is not reproduced."""
        return self.prefix + "/record/lacks"

    @property
    def views(self) -> str:
        return self.prefix + VIEWS_SUFFIX

    @property
    def state(self) -> str:
        return self.prefix + "/state"

    @property
    def requirements(self) -> str:
        """Verdicts, where the machine has requirements (violations.py)."""
        return self.prefix + "/requirements"

    @property
    def events(self) -> str:
        """Where its algorithms report any (events.py)."""
        return self.prefix + "/events"

    @property
    def topics(self) -> set[str]:
        return {self.checkpoint, self.writes, self.state, *self.outputs.values()}


@dataclass(frozen=True)
class Place:
    """A record of one of a bag's files: the number of the file, and where the record begins."""

    file: int = 0
    begin: int = 0


class Bag:
    """One bag: a directory as ROS 2 writes it, or a single .mcap file. Raises BagError for anything else.

    `notes` are remarks for the user on how the bag was read. `read_bytes` of the bag's files have been read by the pass
    over its messages that is under way; it is in the file number `reading`, and could not read `lost` parts before the
    message that it gave last.
    """

    def __init__(self, path: str | Path):
        self.path = Path(path)
        self.truncated = ""
        self.notes: list[str] = []
        self.topics: dict[str, Topic] = {}
        #: By topic, its types and definitions.
        self._kinds: dict[str, dict[tuple[str, str, str], Topic]] = {}
        self.read_bytes = self.reading = self.lost = 0
        self._summaries: dict[Path, Any] = {}
        #: What defines channels: the summary, or a pass over the file if it has none.
        self._known: dict[Path, Any] = {}
        self._damage: dict[Path, str] = {}
        self._chunks: dict[str, list[Place] | None] = {}
        self._stores: dict[str, Typestore] = {}
        self._layouts: dict[str, Layout | None] = {}
        self._open()

    def _open(self) -> None:
        """Finds the files and fills `topics`."""
        self.files = bag_files(self.path)
        # Only the first file must be intact: a recorder that was killed while it began the next file left that one
        # empty.
        check_begin(self.files[0])
        for file in self.files:
            self._take_inventory(file)

    # ---- contents ------------------------------------------------------------------------------------------

    def _take_inventory(self, file: Path) -> None:
        """Fills `topics` from the file's summary, or from all its messages if it has none."""
        summary = self._summaries[file] = self._known[file] = read_summary(file)
        if summary is not None:
            counts = summary.statistics.channel_message_counts
            for number, channel in summary.channels.items():
                self._count(_topic(channel, summary.schemas.get(channel.schema_id), counts.get(number, 0)))
            return
        scan, progress = Scan(file), Progress(f"reading {file.name}", file.stat().st_size)
        self._known[file] = scan
        counts = dict.fromkeys(scan.channels, 0)
        for batch in scan.batches(None):
            progress.at(scan.position)
            for number, count in zip(*np.unique(batch.entries["number"], return_counts=True), strict=True):
                counts[int(number)] = counts.get(int(number), 0) + int(count)
        progress.finish()
        for number, channel in scan.channels.items():
            self._count(_topic(channel, scan.schemas.get(channel.schema_id), counts.get(number, 0)))
        self._damaged(file, scan.damage or f"{file.name} {_without_summary(scan)}")

    def _damaged(self, file: Path, text: str) -> None:
        self._damage[file] = text
        self.truncated = "; ".join(self._damage.values())

    def _count(self, topic: Topic) -> None:
        """Adds messages of a topic. Of several types or definitions `topics` has that of most of its messages, so that it
        does not matter which of them come first.
        """
        kinds = self._kinds.setdefault(topic.name, {})
        kind = topic.type, topic.schema_encoding, topic.schema
        kinds[kind] = replace(topic, count=topic.count + (kinds[kind].count if kind in kinds else 0))
        chosen = min(kinds, key=lambda kind: (not kind[2], -kinds[kind].count, kind))
        self.topics[topic.name] = replace(kinds[chosen], count=sum(part.count for part in kinds.values()))

    def topic(self, name: str) -> Topic:
        """The topic called `name`. Raises BagError, which lists the topics of the bag."""
        topic = self.topics.get(name)
        if topic is None:
            listed = "".join(f"\n  {t.name} [{t.type}], {t.count} messages" for t in self.topics.values())
            hint = did_you_mean(name, self.topics)
            damage = f" ({self.truncated})" if self.truncated else ""
            raise BagError(f"{self.path}: no topic `{name}`{hint}; it holds:{listed or ' nothing'}{damage}")
        return topic

    def messages(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """(topic, log time in ns, CDR bytes); only those of `topics`, if given.

        They come in the order of their log times, and those of one time in the order of the file. The topics of a
        recorded machine come in the order of the file, which is that of the run: the clock may have been set back, or an
        earlier checkpoint restored.
        Passes over what is damaged, and then sets `truncated`.
        """
        return _one_by_one(self.batches(topics))

    def messages_before_damage(self, topics: Collection[str] | None = None) -> Iterator[tuple[str, int, bytes]]:
        """In the order of the file; ends where the first of them may be missing."""
        return _one_by_one(self._in_file_order(topics, beyond_damage=False))

    def messages_from(self, topics: Collection[str], place: Place | None) -> Iterator[tuple[str, int, bytes]]:
        """In the order of the file from a place on, which `chunks_of` gave (None: all of them), those behind damage, too."""
        if place is None:
            return _one_by_one(self._in_file_order(topics, beyond_damage=True))
        return _one_by_one(self._from(place, topics, beyond_damage=True))

    def chunks_of(self, topic: str) -> list[Place] | None:
        """Where the chunks begin that have messages of a topic, in the order of the files; None if an index is missing."""
        if topic not in self._chunks:
            self._chunks[topic] = self._find_chunks(topic)
        return self._chunks[topic]

    def _find_chunks(self, topic: str) -> list[Place] | None:
        found = []
        for number, file in enumerate(self.files):
            summary = self._summaries.get(file)
            if summary is None:
                return None
            channels = {n for n, channel in summary.channels.items() if channel.topic == topic}
            for chunk in sorted(summary.chunk_indexes, key=lambda chunk: chunk.chunk_start_offset):
                if not chunk.message_index_offsets:
                    return None
                if channels & chunk.message_index_offsets.keys():
                    found.append(Place(number, chunk.chunk_start_offset))
        return found

    def chunk(self, place: Place, topic: str) -> list[bytes]:
        """The messages of a topic in the chunk at this place."""
        file = self.files[place.file]
        batches = Scan(file, self._known.get(file)).chunk(place.begin, {topic})
        return [batch.data[begin:end] for batch in batches for _, _, begin, end in batch.entries.tolist()]

    def batches(self, topics: Collection[str] | None = None, in_order: bool = True) -> Iterator[Block]:
        """Like `messages`, many at a time; some batches are empty.

        The mapping gives the topic of each channel number in the batch (with count 0). `in_order` False: for who needs no
        order, which costs memory where a file is not in order.
        """
        wanted = self.topics.keys() if topics is None else topics
        own = tuple(f"{machine.prefix}/" for machine in self.machines(by_bystanders=True))
        if not in_order or any(name.startswith(own) for name in wanted):
            return self._in_file_order(topics, beyond_damage=True)
        return self._in_time_order(topics)

    def _in_file_order(self, topics: Collection[str] | None, beyond_damage: bool) -> Iterator[Block]:
        return self._from(Place(), topics, beyond_damage)

    def _from(self, place: Place, topics: Collection[str] | None, beyond_damage: bool) -> Iterator[Block]:
        self.read_bytes = self.lost = before = lost = 0
        for number, file in list(enumerate(self.files))[place.file :]:
            self.reading, begin = number, place.begin if number == place.file else 0
            scan = Scan(file, self._summaries.get(file))
            announced: dict[int, Topic] = {}
            for batch in scan.batches(topics, begin):
                self.read_bytes = before + scan.position
                if scan.lost and not beyond_damage:
                    break
                self.lost = lost + scan.lost
                self._announce_all(scan, announced)
                yield batch, announced
            found = "" if begin else self._judged(scan, beyond_damage)
            if found and not beyond_damage:
                return
            lost += scan.lost or bool(found)
            before += file.stat().st_size

    def _in_time_order(self, topics: Collection[str] | None) -> Iterator[Block]:
        self.read_bytes = 0
        scans = [Scan(file, self._known.get(file)) for file in self.files]
        with ExitStack() as opened:
            parts = [
                Part(first_ns, partial(self._announcing, scan, announced, batches))
                for scan, announced in [(scan, dict[int, Topic]()) for scan in scans]
                for first_ns, batches in opened.enter_context(scan.parts_by_time(topics))
            ]
            for block in in_time_order(parts, str(self.path)):
                self.read_bytes = sum(scan.position for scan in scans)
                yield block
        for scan in scans:
            self._judged(scan, beyond_damage=True)

    def _announcing(
        self, scan: Scan, announced: dict[int, Topic], batches: Callable[[], Iterator[Batch]]
    ) -> Iterator[Block]:
        for batch in batches():
            self._announce_all(scan, announced)
            yield batch, announced

    def _judged(self, scan: Scan, beyond_damage: bool) -> str:
        """What a pass over a file found to be damaged, which `truncated` then tells, too."""
        found = scan.damage or _too_few(scan, self._summaries.get(scan.file))
        if found and (beyond_damage or scan.file not in self._damage):
            self._damaged(scan.file, found)
        return found

    def _announce_all(self, scan: Scan, announced: dict[int, Topic]) -> None:
        for number in scan.channels.keys() - announced.keys():
            announced[number] = self._announce(scan, number)

    def _announce(self, scan: Scan, number: int) -> Topic:
        channel = scan.channels[number]
        topic = _topic(channel, scan.schemas.get(channel.schema_id))
        self.topics.setdefault(topic.name, topic)
        return topic

    def topic_batches(self, topics: Collection[str]) -> Iterator[tuple[str, Batch]]:
        """Like `messages`, one topic's messages of a batch at a time. Each topic's messages are in their order."""
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
                    f"{info.schema_encoding or 'missing'} schema; ROS 2 messages (cdr, ros2msg) are required"
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
        """`decode` for messages that FCSL defines. Also raises BagError if one of `fields` is not in the schema."""
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
        """The messages of a batch, all of `topic`, as rows of its fixed layout.

        Raises BagError if one does not match it.
        """
        fits, rows = self.fixed_layout(topic).read(batch.data, batch.entries)
        if not fits.all():
            _, _, begin, end = batch.entries[fits.argmin()].tolist()
            raise BagError(f"{self.path}: a message of `{topic}` ({end - begin} bytes) does not match its schema")
        return rows

    # ---- machines ------------------------------------------------------------------------------------------

    def machines(self, by_bystanders: bool = False) -> list[RecordedMachine]:
        """The machines that this bag records, on request those of `fcsl bus record`, too; empty for a bag that FCSL did
        not record.
        """
        found = []
        for name in self.topics:
            if not name.endswith(_CHECKPOINT_SUFFIX):
                continue
            prefix = name.removesuffix(_CHECKPOINT_SUFFIX)
            if prefix + _DESCRIPTOR_SUFFIX in self.topics:
                if by_bystanders:
                    found.append(RecordedMachine(prefix.rsplit("/", 1)[-1], prefix, {}, by_bystander=True))
                continue
            outputs = {
                topic.name.removeprefix(prefix + "/").replace("/", "."): topic.name
                for topic in self.topics.values()
                if topic.name.startswith(prefix + "/")
                and not topic.name.startswith(prefix + "/record/")
                and not topic.type.startswith(_OWN_PACKAGE)
                and (topic.type.endswith("Outputs") or not is_made_for_a_record(topic))
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

    def machine(self, wanted: str = "", by_bystanders: bool = False) -> RecordedMachine:
        """The machine named `wanted` (or its topic prefix), or the only one. Raises BagError."""
        machines = self.machines(by_bystanders)
        if not machines and self.truncated:
            raise BagError(f"{self.path}: damaged or cut off before the first record of a machine ({self.truncated})")
        if not machines and self.machines(by_bystanders=True):
            raise BagError(
                f"{self.path}: `fcsl bus record` made it: it has the values of channels, not all outputs and states of "
                "a machine; `fcsl replay` runs it"
            )
        if not machines:
            raise BagError(
                f"{self.path}: not a recording of a machine (no topic */record/checkpoint); "
                "to run a machine on a bag that FCSL did not record, use `fcsl replay` with --map"
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

    def lacks(self, machine: RecordedMachine) -> str:
        """Why the bag of a bystander does not reproduce the machine's run; "" if nothing says so."""
        messages = self.messages({machine.lacks}) if machine.lacks in self.topics else ()
        return next((str(self.decode_own(machine.lacks, data, ("data",)).data) for _, _, data in messages), "")

    def views(self, machine: RecordedMachine) -> str:
        """What plots and viewers show of the machine, as the recording host gave it: JSON (docs/reference/language.md, views), of
        which nothing has been checked but its size. "" if there is none; `notes` then say why, if it cannot be read.
        """
        topic = self.topics.get(machine.views)
        data = next((data for _, _, data in self.messages({machine.views})), b"") if topic and topic.count else b""
        if not data:
            return ""
        try:
            if len(data) > _VIEWS_MESSAGE_BYTES_MAX:
                raise BagError(
                    f"{self.path}: the message of `{machine.views}` has {len(data)} bytes, which is too many"
                )
            return str(self.decode_own(machine.views, data, ("data",)).data)
        except BagError as error:
            note = f"{error}; it is ignored"
            self.notes += [] if note in self.notes else [note]
            return ""


def is_made_for_a_record(topic: Topic) -> bool:
    """Whether the recorder made the message type for the chosen fields, so that no ROS 2 interface defines it."""
    return topic.type.partition("/")[0].endswith("_fields")


def _one_by_one(batches: Iterable[Block]) -> Iterator[tuple[str, int, bytes]]:
    for batch, announced in batches:
        for number, log_ns, begin, end in batch.entries.tolist():
            yield announced[number].name, log_ns, batch.data[begin:end]


def _too_few(scan: Scan, summary: Any) -> str:
    """What is wrong with a file that is whole, but has not the messages that its summary counts."""
    if summary is None or scan.count == summary.statistics.message_count:
        return ""
    return f"{scan.file.name} has {scan.count} messages, its summary counts {summary.statistics.message_count}"


def _without_summary(scan: Scan) -> str:
    """The state of a file whose data section is whole, but which has no summary that could be read."""
    if scan.behind > BARE_END_BYTES:
        return f"has a damaged summary; its {scan.count} messages are there"
    return f"was not closed after {scan.count} messages"


def _topic(channel: records.Channel, schema: records.Schema | None, count: int = 0) -> Topic:
    return Topic(
        name=channel.topic,
        type=schema.name if schema else "",
        count=count,
        encoding=channel.message_encoding,
        schema_encoding=schema.encoding if schema else "",
        schema=schema.data.decode("utf-8", "replace") if schema else "",
    )
