# SPDX-License-Identifier: Apache-2.0
"""Converts a bag for the rerun viewer: `fcsl rerun`. scene.py defines the entities."""

from __future__ import annotations

import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import rerun as rr

from ..bag import Bag, formats
from ..bag.states import StateReader
from ..cli import Progress
from ..complete_output import complete_or_absent
from ..errors import BagError
from .blueprint import Plan
from .feed import Feed
from .recorded import MACHINE, RecordedRun
from .scene import Cast, Scene
from .views import Views
from .world import World

#: Messages shown in one batch; bounds the memory.
_MESSAGES = 100_000
#: Most bytes copied in one call.
_PIECE_BYTES = 1 << 20


def to_rerun(
    bag: str | Path | Bag, output: str | Path, machine: str = "", truth: str = "", *, views: Views | None = None
) -> list[str]:
    """Writes the run to `output`, complete or not at all. Returns what is left out. Raises BagError.

    `machine` selects one of several; `truth` is the plant's topic, by default every topic below /<namespace>/sim/.
    `views` takes the place of the bag's own.
    """
    opened = formats.opened(bag)
    run = RecordedRun(opened, machine, truth)
    assert run.machine is not None
    signals = [its for its in run.signals if its.name != MACHINE]
    if not signals:
        raise BagError(f"{opened.path}: machine `{run.name}` recorded nothing to show")
    views, remark = (views, "") if views is not None else run.views()
    outputs = [its for its in signals if its.part == "outputs"]
    inside = [its for its in signals if its.part != "outputs"]
    cast = Cast(run.machine.prefix, outputs, run.states, inside, views, remark, run.violations, run.events)
    layouts = {its.topic: opened.fixed_layout(its.topic) for its in signals}
    rr.set_strict_mode(True)  # otherwise rerun logs invalid data and writes the rest
    with complete_or_absent(output) as partial:
        stream = rr.RecordingStream(f"fcsl_{run.name}", recording_id=opened.path.name)
        with _saved(stream, partial):
            scene = Scene(stream, cast)
            span = run.spans[0].start_s, run.spans[-1].end_s
            # Before the data: otherwise a viewer that shows the file while loading would use a default layout.
            stream.send_blueprint(Plan(cast, scene.world, span, _reach(run, scene.world)).blueprint())
            _play(opened, Feed(scene, layouts, run.machine.state, StateReader(opened, run.machine.state).read))
            scene.until(span[1])
    return scene.left_out


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


def _reach(run: RecordedRun, world: World) -> float:
    """The largest height or distance of the vehicle, in m."""
    rows = run.read(world.places) if world.places else {}
    return world.reach({topic: (its.t_s, its.fields) for topic, its in rows.items()})


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
