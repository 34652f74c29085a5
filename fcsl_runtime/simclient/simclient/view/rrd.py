# SPDX-License-Identifier: Apache-2.0
"""Converts a bag for the rerun viewer: `python -m simclient.to_rerun`. scene.py defines the entities."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path

import rerun as rr

from ..bag import Bag, RecordedMachine, has_stamps, stacks
from ..bag.states import StateReader, visits
from ..cli import Progress, complete_or_absent
from ..errors import BagError
from ..ros.cdr import Layout
from .blueprint import Plan
from .feed import Feed
from .scene import Cast, Scene
from .signals import Signals, signals_of
from .world import World

#: Messages shown in one batch; bounds the memory.
_MESSAGES = 100_000
#: Most bytes copied in one call.
_PIECE_BYTES = 1 << 20


def to_rerun(bag: str | Path | Bag, output: str | Path, machine: str = "", truth: str = "") -> None:
    """Writes the run to `output`, complete or not at all. Raises BagError.

    `machine` selects one of several; `truth` is the plant's topic, by default every topic below /<namespace>/sim/.
    """
    opened = bag if isinstance(bag, Bag) else Bag(bag)
    recorded = opened.machine(machine)
    plant = _plant_topics(opened, recorded, truth)
    outputs = {topic: topic.rsplit("/", 1)[-1] for topic in [*plant, *recorded.outputs.values()]}
    inside = {topic: name for name, topic in recorded.fields.items()}
    layouts = {topic: _layout(opened, topic) for topic in [*outputs, *inside]}
    there = visits(opened, recorded)
    if not layouts:
        raise BagError(f"{opened.path}: machine `{recorded.name}` recorded nothing to show")

    def described(names: Mapping[str, str]) -> list[Signals]:
        return [signals_of(n, t, t in plant, layouts[t], opened.topic(t).schema) for t, n in names.items()]

    states = list(dict.fromkeys(visit.state for visit in there))
    cast = Cast(recorded.prefix, described(outputs), states, described(inside))
    rr.set_strict_mode(True)  # otherwise rerun logs invalid data and writes the rest
    with complete_or_absent(output) as partial:
        stream = rr.RecordingStream(f"fcsl_{recorded.name}", recording_id=opened.path.name)
        with _saved(stream, partial):
            scene = Scene(stream, cast)
            span = there[0].start_ns * 1e-9, there[-1].end_ns * 1e-9
            # Before the data: otherwise a viewer that shows the file while loading would use a default layout.
            stream.send_blueprint(Plan(cast, scene.world, span, _reach(opened, scene.world)).blueprint())
            _play(opened, Feed(scene, layouts, recorded.state, StateReader(opened, recorded.state).read))
            scene.until(span[1])


@contextmanager
def _saved(stream: rr.RecordingStream, file: Path) -> Iterator[None]:
    """Writes to `file` what the block sends to `stream`; ends with OSError unless all of it was written.

    rerun writes into a pipe: on a full disk it would hang, or report success with a part of the file.
    """
    receiving, sending = os.pipe()
    failed: list[OSError] = []
    copying = threading.Thread(target=_copy, args=(receiving, file, failed), daemon=True)
    copying.start()
    try:
        stream.save(f"/dev/fd/{sending}")
        yield
    finally:
        stream.disconnect()
        os.close(sending)
        copying.join()
    if failed:
        raise failed[0]


def _copy(receiving: int, file: Path, failed: list[OSError]) -> None:
    with open(receiving, "rb", buffering=0) as pipe:
        try:
            with file.open("wb") as target:
                shutil.copyfileobj(pipe, target, _PIECE_BYTES)
        except OSError as error:
            failed.append(error)
            while pipe.read(_PIECE_BYTES):  # rerun must not wait for room in the pipe
                pass


def _plant_topics(bag: Bag, machine: RecordedMachine, truth: str) -> list[str]:
    if truth:
        return [bag.topic(truth).name]
    prefix = machine.prefix.rsplit("/", 1)[0] + "/sim/"
    layouts = {topic: bag.layout(topic) for topic in bag.topics if topic.startswith(prefix)}
    return [topic for topic, layout in layouts.items() if layout is not None and has_stamps(layout)]


def _layout(bag: Bag, topic: str) -> Layout:
    layout = bag.layout(topic)
    if layout is None or not has_stamps(layout):
        raise BagError(
            f"{bag.path}: topic `{topic}` [{bag.topic(topic).type}] cannot be shown: no header or no fixed size"
        )
    return layout


def _reach(bag: Bag, world: World) -> float:
    """The largest height or distance of the vehicle, in m."""
    if not world.guide:
        return 0.0
    return max((world.reach({n: rows[n] for n in rows.dtype.names or ()}) for _, rows in stacks(bag, [world.guide])),
               default=0.0)  # fmt: skip


def _play(bag: Bag, feed: Feed) -> None:
    progress = Progress("converting", sum(bag.topics[topic].count for topic in feed.topics))
    for done, (topic, _, data) in enumerate(bag.messages(feed.topics)):
        feed.take(topic, data)
        if done % _MESSAGES == _MESSAGES - 1:
            feed.flush()
            progress.at(done)
    feed.flush()
    if feed.refused:
        raise BagError(f"{bag.path}: {feed.refused} messages do not match their schemas")
