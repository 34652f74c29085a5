# SPDX-License-Identifier: Apache-2.0
"""Checkpoints in the middle of a recording: where they are, that a replay begins at each and checks each, and that one makes
the rest replayable behind host writes that were lost, or behind damage."""

from __future__ import annotations

import os
import struct
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from native import ARMED, COUNT, FIXTURE, GYRO, Run
from test_simclient_bag_damage import index_of

from simclient import BagError
from simclient.bag import Bag
from simclient.bag.keyframes import keyframe_before
from simclient.bag.writer import copy_of
from simclient.replay import replay
from simclient.replay.replaying import open_machine
from simclient.replay.seek import seek

#: The fixture ticks at 100 Hz; its struct is paid for by the ticks of 3.2 s at most.
SECONDS = 30


def checkpoints(bag: Bag) -> list[Any]:
    topic = bag.machine().checkpoint
    return [bag.decode(topic, data) for _, _, data in bag.messages({topic})]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A write before every tenth tick; the machine is armed after 10.55 s, which takes it to another state."""
    run, path = Run(), tmp_path_factory.mktemp("keyframes") / "bag"
    run.record(path)
    for number in range(SECONDS * 10):
        run.set(GYRO, struct.pack("<d", number * 0.37 % 1.0), number % 3)
        if number == 105:
            run.step(5)
            run.set(ARMED, b"\1")
            run.step(5)
        else:
            run.step(10)
    run.call("fcsl_run_record_stop")
    run.call("fcsl_run_close")
    return path


def test_there_is_one_every_few_seconds_and_the_replay_checks_all(bag: Path) -> None:
    ticks = [checkpoint.tick for checkpoint in checkpoints(Bag(bag))]
    assert ticks == sorted(set(ticks)) and ticks[0] == 0
    assert SECONDS / 4 < len(ticks) <= SECONDS + 1
    verdict = replay(bag, library=FIXTURE)
    assert verdict.identical and verdict.ticks == SECONDS * 100 and verdict.checkpoints == len(ticks) - 1


def test_there_is_one_at_a_change_of_state(bag: Path) -> None:
    opened = Bag(bag)
    topic = f"{opened.machine().prefix}/transitions"
    changes = [opened.decode(topic, data).tick + 1 for _, _, data in opened.messages({topic})]
    assert changes and set(changes) <= {checkpoint.tick for checkpoint in checkpoints(opened)}


def test_the_last_one_before_a_tick_is_found_by_the_index(bag: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened = Bag(bag)
    ticks = [checkpoint.tick for checkpoint in checkpoints(opened)]
    monkeypatch.setattr(Bag, "messages", None)  # no pass over the bag
    for tick in [0, 1, *ticks, *(tick - 1 for tick in ticks[1:]), SECONDS * 100, 10**9]:
        assert keyframe_before(opened, opened.machine(), tick).tick == max(t for t in ticks if t <= tick)


def test_without_an_index_the_same_one_is_found(bag: Path, tmp_path: Path) -> None:
    (file,) = bag.glob("*.mcap")
    content = file.read_bytes()
    (tmp_path / "cut.mcap").write_bytes(content[: len(content) * 3 // 4])
    cut, whole = Bag(tmp_path / "cut.mcap"), Bag(bag)
    found = keyframe_before(cut, cut.machine(), 1234)
    assert found.place is None and found.data == keyframe_before(whole, whole.machine(), 1234).data


@pytest.mark.parametrize("tick", [0, 777, 1234, 2999])
def test_a_replay_begins_at_any_tick(bag: Path, tick: int) -> None:
    verdict = replay(bag, library=FIXTURE, from_tick=tick)
    first = int(verdict.notes[0].rpartition(" ")[2])
    assert verdict.identical and first <= tick and verdict.ticks == SECONDS * 100 - first


def test_a_run_is_brought_to_any_tick(bag: Path) -> None:
    opened = Bag(bag)
    there, through = open_machine("", FIXTURE, None), open_machine("", FIXTURE, None)
    seek(opened, opened.machine(), through, 0)
    for tick in (1500, 1501, 40, 2990):
        seek(opened, opened.machine(), there, tick)
        assert there.tick == tick
    with pytest.raises(BagError, match="up to tick 5000"):
        seek(opened, opened.machine(), there, 5000)


def altered(bag: Path, target: Path, change: Callable[[Any], Any]) -> Path:
    """A copy with the fourth checkpoint changed."""
    opened = Bag(bag)
    topic, count = opened.machine().checkpoint, 0
    with copy_of(opened, target, opened.topics) as copy:
        for name, log_ns, data in opened.messages():
            count += name == topic
            if name == topic and count == 4:
                message = opened.decode(topic, data)
                change(message)
                data = bytes(opened.store(topic).serialize_cdr(message, opened.topic(topic).type))
                count += 1
            copy.write(name, log_ns, data)
    return target


def test_a_checkpoint_that_differs_in_one_bit_is_named(bag: Path, tmp_path: Path) -> None:
    run = open_machine("", FIXTURE, None)
    field = list(run.machine.fields.values())[COUNT]

    def flip(message: Any) -> None:
        message.data = np.array(message.data)
        message.data[field.offset] ^= 1

    other = altered(bag, tmp_path / "flipped", flip)
    verdict = replay(other, library=FIXTURE)
    tick = checkpoints(Bag(bag))[3].tick
    assert verdict.divergence is not None and verdict.divergence.tick == tick
    assert verdict.divergence.path == f"{field.path} (in the checkpoint)"


def test_a_checkpoint_that_cannot_be_restored_is_named(bag: Path, tmp_path: Path) -> None:
    def shorten(message: Any) -> None:
        message.data = np.array(message.data)[:-8]

    other = altered(bag, tmp_path / "short", shorten)
    tick = checkpoints(Bag(bag))[3].tick
    assert replay(other, library=FIXTURE).divergence is not None
    with pytest.raises(BagError, match=f"the checkpoint of tick {tick} cannot be used"):
        replay(other, library=FIXTURE, from_tick=tick)


def test_a_replay_goes_on_behind_damage(bag: Path, tmp_path: Path) -> None:
    (file,) = bag.glob("*.mcap")
    content = bytearray(file.read_bytes())
    chunk = sorted(index_of(file).chunk_indexes, key=lambda c: c.chunk_start_offset)[1]
    content[chunk.chunk_start_offset + 100] ^= 1
    (tmp_path / "damaged.mcap").write_bytes(content)
    verdict = replay(tmp_path / "damaged.mcap", library=FIXTURE)
    assert verdict.divergence is None and not verdict.identical
    assert "were not verified: the bag is incomplete" in verdict.missing[0]
    assert SECONDS * 50 < verdict.ticks < SECONDS * 100 and verdict.checkpoints > 0


#: Stands before pwrite: while the file $GATE is there, no call returns.
GATE = """
#define _GNU_SOURCE
#include <stdlib.h>
#include <sys/syscall.h>
#include <unistd.h>

ssize_t pwrite64(int file, const void *data, size_t size, off_t at) {
    while (access(getenv("GATE"), F_OK) == 0) {
        usleep(1000);
    }
    return syscall(SYS_pwrite64, file, data, size, at);
}
"""
#: argv: bag, gate. The disk hangs until writes are lost, and then for another 500 of them.
HANGS = """
import struct, sys, time
sys.path.insert(0, {folder!r})
from pathlib import Path
from native import GYRO, Run
bag, gate, run = Path(sys.argv[1]), Path(sys.argv[2]), Run()
run.record(bag, lossless=False)
number = 0

def fly(ticks):
    global number
    for _ in range(ticks):
        run.set(GYRO, struct.pack("<d", number * 0.37 % 1.0), number % 3)
        run.step(1)
        number += 1

fly(500)
gate.touch()
while True:
    before = run.dropped()
    fly(1)
    if run.dropped() >= before + 2:  # the tick and the write
        break
fly(500)
gate.unlink()
while True:
    before = run.dropped()
    time.sleep(0.01)
    fly(20)
    if run.dropped() == before:
        break
fly(1000)
drops = run.drops()
run.call("fcsl_run_record_stop")
print(number, drops.ring_full, drops.keyframes)
"""


def test_a_keyframe_makes_the_rest_replayable_when_writes_were_lost(tmp_path: Path) -> None:
    library, gate = tmp_path / "gate.so", tmp_path / "gate"
    (tmp_path / "gate.c").write_text(GATE)
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "gate.c"], check=True)
    line = [sys.executable, "-B", "-c", HANGS.format(folder=str(Path(__file__).parent)), tmp_path / "bag", gate]
    environment = {**os.environ, "LD_PRELOAD": str(library), "GATE": str(gate)}
    done = subprocess.run(line, env=environment, capture_output=True, text=True, timeout=300, check=True)
    ticks, dropped, keyframes = map(int, done.stdout.split())
    assert dropped > 500 and keyframes > 0
    verdict = replay(tmp_path / "bag", library=FIXTURE)
    assert verdict.divergence is None, verdict
    lost = [text for text in verdict.missing if "host writes found no room" in text]
    assert lost and all(text.startswith("ticks ") for text in lost)
    assert 1500 < verdict.ticks < ticks - 500
