# SPDX-License-Identifier: Apache-2.0
"""Topics of a map that a bag does not have: `tf:odom->base_link`, the pose of one frame in another.

Their messages are geometry_msgs/TransformStamped, as tf2's lookup_transform("odom", "base_link") gives them, composed
from the bag's /tf and /tf_static. Everything behind reads them as it reads a topic of the bag.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence

import numpy as np
from rosbags.typesys import Stores, get_typestore

from ..bag import Bag, Topic
from ..bag.batch import ENTRY, Batch
from ..errors import BagError, MapError
from .frames import Chain, Frames
from .mapping import Entry

_PREFIX, _ARROW = "tf:", "->"
_TYPE = "geometry_msgs/msg/TransformStamped"
#: A message ends with seven doubles: translation x, y, z, rotation x, y, z, w.
_NUMBERS_BYTES = 7 * 8
#: Seconds and nanoseconds of the stamp, behind the encapsulation.
_STAMP_AT = slice(4, 12)


def with_transforms(bag: Bag, entries: Sequence[Entry], header_time: bool) -> Bag:
    """`bag` with a topic for each `tf:PARENT->CHILD` among the topics of `entries`; `bag` itself if there is none.

    Raises MapError, which names the entry whose frames the bag does not have.
    """
    wanted = {entry.topic: entry for entry in reversed(entries) if entry.topic.startswith(_PREFIX)}
    if not wanted:
        return bag
    frames = None
    made = {}
    for name, entry in wanted.items():
        target, arrow, source = (part.strip() for part in name.removeprefix(_PREFIX).partition(_ARROW))
        if not (target and arrow and source) or target == source:
            raise MapError(f"{entry.location}: `{name}` names no two frames; write {_PREFIX}PARENT{_ARROW}CHILD")
        try:
            frames = frames or Frames(bag, header_time)
            made[name] = frames.between(target.lstrip("/"), source.lstrip("/"))
        except BagError as error:
            raise MapError(f"{entry.location}: {error}") from None
    return _BagWithTransforms(bag, made, header_time)


class _BagWithTransforms(Bag):
    """A bag with further topics."""

    def __init__(self, bag: Bag, chains: Mapping[str, Chain], header_time: bool):
        self._bag = bag
        self._made = {name: _messages(name, chain, header_time) for name, chain in chains.items()}
        super().__init__(bag.path)
        self.truncated = bag.truncated  # each pass over a file finds all of its damage
        self.notes = [*bag.notes, *(note for name, chain in chains.items() for note in _notes(name, chain))]

    def _open(self) -> None:
        schema = get_typestore(Stores.ROS2_JAZZY).generate_msgdef(_TYPE, ros_version=2)[0]
        made = {n: Topic(n, _TYPE, len(batch.entries), "cdr", "ros2msg", schema) for n, batch in self._made.items()}
        self.files, self.topics = self._bag.files, self._bag.topics | made

    def batches(
        self, topics: Collection[str] | None = None, in_order: bool = True
    ) -> Iterator[tuple[Batch, Mapping[int, Topic]]]:
        wanted = self.topics.keys() if topics is None else topics
        if others := [name for name in wanted if name not in self._made]:
            yield from self._bag.batches(others, in_order)
        for name in wanted:
            if name in self._made:
                yield self._made[name], {0: self.topics[name]}


def _messages(name: str, chain: Chain, header_time: bool) -> Batch:
    """The transforms as CDR. Those that are placed by the time of recording have no stamp."""
    store = get_typestore(Stores.ROS2_JAZZY)
    target, _, source = name.removeprefix(_PREFIX).partition(_ARROW)
    types = store.types
    zero = types["geometry_msgs/msg/Transform"](
        translation=types["geometry_msgs/msg/Vector3"](x=0.0, y=0.0, z=0.0),
        rotation=types["geometry_msgs/msg/Quaternion"](x=0.0, y=0.0, z=0.0, w=0.0),
    )
    stamp = types["builtin_interfaces/msg/Time"](sec=0, nanosec=0)
    header = types["std_msgs/msg/Header"](stamp=stamp, frame_id=target.strip())
    blank = types[_TYPE](header=header, child_frame_id=source.strip(), transform=zero)
    count = len(chain.times_ns)
    rows = np.tile(np.frombuffer(bytes(store.serialize_cdr(blank, _TYPE)), np.uint8), (count, 1))
    if header_time:
        stamps = np.stack((chain.times_ns // 10**9, chain.times_ns % 10**9), axis=1).astype("<u4")
        rows[:, _STAMP_AT] = stamps.view(np.uint8)
    numbers = np.concatenate((chain.poses.position, chain.poses.rotation), axis=1).astype("<f8")
    rows[:, -_NUMBERS_BYTES:] = np.broadcast_to(numbers, (count, 7)).copy().view(np.uint8)
    entries = np.zeros(count, ENTRY)
    entries["log_ns"] = chain.times_ns
    entries["begin"] = np.arange(count) * rows.shape[1]
    entries["end"] = entries["begin"] + rows.shape[1]
    return Batch(rows.tobytes(), entries)


def _notes(name: str, chain: Chain) -> Iterator[str]:
    for link in chain.links:
        if link.refused:
            yield f"{name}: {link}: refused: {', '.join(link.refused)}"
    if chain.outside:
        yield f"{name}: {chain.outside} times are left out, at which not every transform of the chain is known"
