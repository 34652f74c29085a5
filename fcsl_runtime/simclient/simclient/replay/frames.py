# SPDX-License-Identifier: Apache-2.0
"""The frames of a bag: the transforms of /tf and /tf_static as links, and the chain of links between two frames.

A link is the pose of a child frame in its parent. Those of /tf have a pose per message, those of /tf_static one for all
times: the newest that is usable.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..bag import Bag
from ..cli import Progress
from ..errors import BagError, did_you_mean
from .poses import Poses, are_rotations, compose, identity, interpolate, inverse
from .sample_extraction import NO_STAMP, STUCK, refusals
from .tick_alignment import Array, screen

TF, TF_STATIC = "/tf", "/tf_static"
#: The types of both topics, in ROS 2 and in the oldest bags of ROS 1.
_TYPES = ("tf2_msgs/msg/TFMessage", "tf/msg/tfMessage")
_MAX_LISTED = 50


@dataclass
class _Samples:
    """The transforms of one parent, child and topic as they come, a row each."""

    stamps: list[tuple[int, int]] = field(default_factory=list)  # seconds, nanoseconds
    log_ns: list[int] = field(default_factory=list)
    numbers: list[tuple[float, ...]] = field(default_factory=list)  # position x, y, z, rotation x, y, z, w


@dataclass(frozen=True, eq=False)
class Link:
    """The poses of `child` in `parent`: at `times_ns` (ascending), or for a static link one pose and no time.

    `refused` tells what became of the unusable ones.
    """

    parent: str
    child: str
    times_ns: Array | None
    poses: Poses
    refused: tuple[str, ...]

    def __str__(self) -> str:
        return f"{self.parent}->{self.child}"

    def at(self, times_ns: Array) -> Poses:
        return self.poses if self.times_ns is None else interpolate(self.times_ns, self.poses, times_ns)


@dataclass(frozen=True, eq=False)
class Chain:
    """The poses of one frame in another at `times_ns`; `links` between them; `outside`: times that not all links cover."""

    times_ns: Array
    poses: Poses
    links: tuple[Link, ...]
    outside: int


class Frames:
    """All frames of a bag. Reads /tf and /tf_static once."""

    def __init__(self, bag: Bag, header_time: bool):
        """`header_time`: transforms are placed by their stamps, else by the time of recording. Raises BagError."""
        self._path = bag.path
        self._parents: dict[str, list[Link]] = {}
        for (topic, parent, child), samples in _read(bag).items():
            self._parents.setdefault(child, []).append(_link(topic, parent, child, samples, header_time))
        self._names = sorted({*self._parents, *(link.parent for links in self._parents.values() for link in links)})

    def between(self, target: str, source: str) -> Chain:
        """The poses of frame `source` in frame `target`, at every time of a link from /tf that lies within the times of
        all of them. Raises BagError, which lists the frames.
        """
        for name in (target, source):
            if name not in self._names:
                raise self._error(f"no frame `{name}`{did_you_mean(name, self._names)}; it has {_listed(self._names)}")
        (up, above_target), (down, above_source) = self._upwards(target), self._upwards(source)
        shared = {link.child for link in up} & {link.child for link in down}
        up, down = ([link for link in links if link.child not in shared] for links in (up, down))
        if (up[-1].parent if up else target) != (down[-1].parent if down else source):
            links = _listed([str(link) for links in self._parents.values() for link in links])
            why = above_source or above_target or f"it has {links}"
            raise self._error(f"nothing connects the frames `{target}` and `{source}`; {why}")
        chain = (*up, *reversed(down))
        times_ns, outside = self._times(chain, f"`{target}` and `{source}`")
        poses = compose(inverse(_along(reversed(up), times_ns)), _along(reversed(down), times_ns))
        return Chain(times_ns, poses, chain, outside)

    def _error(self, text: str) -> BagError:
        return BagError(f"{self._path}: {TF} and {TF_STATIC}: {text}")

    def _upwards(self, frame: str) -> tuple[list[Link], str]:
        """The links from a frame up to its root, or to a frame with several parents; and what to say of that one."""
        links: list[Link] = []
        seen = {frame}
        while frame in self._parents:
            above = self._parents[frame]
            if len(above) > 1:
                return links, f"frame `{frame}` has several parents: {_listed([str(link) for link in above])}"
            frame = above[0].parent
            if frame in seen:
                circle = _listed([str(link) for link in (*links, *above)])
                raise self._error(f"frame `{frame}` is its own ancestor: {circle}")
            links += above
            seen.add(frame)
        return links, ""

    def _times(self, chain: Iterable[Link], between: str) -> tuple[Array, int]:
        """Times at which every link of the chain has a pose, and the number of times at which only some have."""
        unusable = [link for link in chain if not len(link.poses.position)]
        if unusable:
            raise self._error(f"no transform of {unusable[0]} can be used: {', '.join(unusable[0].refused)}")
        moving = [link.times_ns for link in chain if link.times_ns is not None]
        if not moving:
            raise self._error(f"all transforms between {between} are static, so there is no time to compare at")
        every = np.unique(np.concatenate(moving))
        inside = (every >= max(t[0] for t in moving)) & (every <= min(t[-1] for t in moving))
        if not inside.any():
            raise self._error(f"the transforms between {between} have no time in common")
        return every[inside], int(np.count_nonzero(~inside))


def _listed(names: Iterable[str]) -> str:
    every = sorted(names)
    more = f" and {len(every) - _MAX_LISTED} more" if len(every) > _MAX_LISTED else ""
    return ", ".join(every[:_MAX_LISTED]) + more


def _along(links: Iterable[Link], times_ns: Array) -> Poses:
    """The poses of the last link's child in the first link's parent; the links go down."""
    poses = identity()
    for link in links:
        poses = compose(poses, link.at(times_ns))
    return poses


def _read(bag: Bag) -> dict[tuple[str, str, str], _Samples]:
    """The transforms by topic, parent and child."""
    topics = [bag.topic(name) for name in (TF, TF_STATIC) if name in bag.topics]
    if not topics:
        bag.topic(TF)
    for topic in topics:
        if topic.type not in _TYPES:
            raise BagError(f"{bag.path}: `{topic.name}` is {topic.type}, not {_TYPES[0]}")
    found: dict[tuple[str, str, str], _Samples] = {}
    damaged = done = 0
    progress = Progress(f"reading {TF}", sum(topic.count for topic in topics))
    for name, log_ns, data in bag.messages({topic.name for topic in topics}):
        done += 1
        progress.at(done)
        try:
            transforms = bag.decode(name, data).transforms
        except BagError:
            damaged += 1
            continue
        for transform in transforms:
            _add(found, name, log_ns, transform)
    progress.finish()
    if damaged:
        bag.notes.append(f"{TF} and {TF_STATIC}: {damaged} damaged messages were passed over")
    return found


def _add(found: dict[tuple[str, str, str], _Samples], topic: str, log_ns: int, transform: Any) -> None:
    """ROS 1 allowed frames to begin with a slash; tf2 strips it."""
    names = (transform.header.frame_id.lstrip("/"), transform.child_frame_id.lstrip("/"))
    samples = found.setdefault((topic, *names), _Samples())
    stamp, p, q = transform.header.stamp, transform.transform.translation, transform.transform.rotation
    samples.stamps.append((stamp.sec, stamp.nanosec))
    samples.log_ns.append(log_ns)
    samples.numbers.append((p.x, p.y, p.z, q.x, q.y, q.z, q.w))


def _link(topic: str, parent: str, child: str, samples: _Samples, header_time: bool) -> Link:
    numbers, log_ns = np.array(samples.numbers, np.float64), np.array(samples.log_ns, np.int64)
    seconds, rest = np.array(samples.stamps, np.int64).T
    # Of one time of recording by stamp and content, so that it does not matter in which order a file has them.
    order = np.lexsort((*numbers.T, rest, seconds, log_ns))
    numbers, log_ns, seconds, rest = numbers[order], log_ns[order], seconds[order], rest[order]
    sound = {
        "nan": np.isfinite(numbers).all(axis=1),
        "rotation": are_rotations(numbers[:, 3:]),
        "stamp": (seconds >= 0) & (rest >= 0) & (rest < 10**9) | (topic == TF_STATIC) | (not header_time),
    }
    usable = np.ones(len(log_ns), bool)
    refused: dict[str, tuple[int, int]] = {}

    def keep(reason: str, good: Array) -> None:
        nonlocal usable
        bad = usable & ~good
        if bad.any():
            refused[reason] = (int(np.count_nonzero(bad)), int(bad.argmax()))
        usable = usable & good

    for reason, good in sound.items():
        keep(reason, good)
    times_ns = seconds * 10**9 + rest if header_time else log_ns
    if topic == TF:
        if header_time:
            keep(NO_STAMP, times_ns != 0)
        timed = usable.copy()
        timed[usable], _ = screen(times_ns[usable], log_ns[usable], header_time)
        keep(STUCK, timed)
    chosen = _last_of_each_time(times_ns, usable) if topic == TF else np.flatnonzero(usable)[-1:]
    rotation = numbers[chosen, 3:]
    poses = Poses(numbers[chosen, :3], rotation / np.linalg.norm(rotation, axis=1, keepdims=True))
    return Link(parent, child, times_ns[chosen] if topic == TF else None, poses, tuple(refusals(refused)))


def _last_of_each_time(times_ns: Array, usable: Array) -> Array:
    """Index of the usable samples in the order of their times; of those with one time, the last."""
    there = np.flatnonzero(usable)
    order = there[np.argsort(times_ns[there], kind="stable")]
    ordered = times_ns[order]
    return order[np.append(ordered[1:] != ordered[:-1], True)] if len(order) else order
