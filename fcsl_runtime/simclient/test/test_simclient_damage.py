# SPDX-License-Identifier: Apache-2.0
"""Damaged bags: every reader says what is wrong with them, none of them fails with anything but BagError."""

from __future__ import annotations

import random
import subprocess
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

from simclient import AlgTwin, BagError
from simclient.bag import Bag
from simclient.bag.digest import digest
from simclient.replay import replay
from simclient.view.recorded import RecordedRun


@pytest.fixture
def bag(probe: Path, tmp_path: Path) -> Path:
    """One second of the probe: 100 ticks, with a state change."""
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.tick(40)
        twin.set_state("ACTIVE")
        twin.tick(60)
    return tmp_path / "run"


def everything(opened: Bag) -> None:
    """Reads all that a picture may draw."""
    run = RecordedRun(opened)
    run.read(run.catalogue.values.values())


def test_damage_anywhere_is_a_message(bag: Path, probe: Path) -> None:
    file = bag / "run_0.mcap"
    whole = file.read_bytes()
    random_of = random.Random(20)
    readers = {"pictures": everything, "digest": digest, "replay": lambda opened: replay(opened, library=str(probe))}
    outcomes = {name: {"read": 0, "refused": 0} for name in readers}
    for variant in range(40):
        damaged = bytearray(whole)
        if variant % 3 == 0:
            del damaged[random_of.randrange(len(whole)) :]
        else:
            for _ in range(random_of.choice((1, 3, 50))):
                damaged[random_of.randrange(len(whole))] ^= 1 << random_of.randrange(8)
        file.write_bytes(damaged)
        for name, reader in readers.items():
            try:
                reader(Bag(bag))
                outcomes[name]["read"] += 1
            except BagError as error:
                assert "run" in str(error)
                outcomes[name]["refused"] += 1
    assert all(count > 0 for of in outcomes.values() for count in of.values()), outcomes


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"", "empty; nothing was written"),
        (b"\x89MC", "cut off after 3 bytes"),
        (random.Random(1).randbytes(5000), "not an MCAP file"),
        (None, "damaged or cut off before the first record of a machine (run_0.mcap breaks off after "),
    ],
)
def test_a_bag_without_a_beginning(bag: Path, content: bytes | None, reason: str) -> None:
    file = bag / "run_0.mcap"
    file.write_bytes(file.read_bytes()[:600] if content is None else content)
    with pytest.raises(BagError) as caught:
        digest(bag)
    assert reason in str(caught.value)


def test_an_empty_last_file_is_a_recording_cut_off(bag: Path) -> None:
    (bag / "metadata.yaml").unlink()
    (bag / "run_1.mcap").write_bytes(b"")
    opened = Bag(bag)
    assert opened.truncated == "run_1.mcap breaks off after 0 messages"
    assert digest(opened) == digest(bag / "run_0.mcap")


@pytest.mark.parametrize(("tool", "suffix"), [("plot", "png"), ("rerun", "rrd")])
def test_viewers_say_that_a_bag_is_incomplete(bag: Path, tool: str, suffix: str) -> None:
    file = bag / "run_0.mcap"
    whole = file.read_bytes()
    picture = bag.parent / f"x.{suffix}"
    command = ["fcsl", tool, str(bag), "-o", str(picture)]
    file.write_bytes(whole[: len(whole) - 100])
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 1 and picture.stat().st_size > 1000
    assert done.stderr.startswith(f"fcsl {tool}: the bag is incomplete: run_0.mcap ")

    picture.unlink()
    middle = bytearray(whole)
    with BytesIO(whole) as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    ticks = summary.chunk_indexes[1]  # the first is that of the checkpoint
    middle[ticks.chunk_start_offset + ticks.chunk_length // 2] ^= 1  # nothing of the chunk can be trusted
    file.write_bytes(middle)
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 2 and not picture.exists()
    assert "no tick of machine `probe` is in the bag (run_0.mcap lacks 0.000000000 s to " in done.stderr


def test_a_lost_part_is_a_gap_in_pictures(probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "run")
        twin.tick(4000)
    file = tmp_path / "run/run_0.mcap"
    content = bytearray(file.read_bytes())
    with BytesIO(content) as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None and len(summary.chunk_indexes) > 3
    lost = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    content[lost.chunk_start_offset + lost.chunk_length // 2] ^= 1
    file.write_bytes(content)
    run = RecordedRun(Bag(tmp_path / "run"))
    value = run.catalogue.values["echo.outputs.count"]
    rows = run.read([value])[value.signals.topic]
    (gap,) = np.flatnonzero(np.isnan(rows.fields["count"])).tolist()
    ticks = np.delete(rows.fields["count"], gap)
    assert np.diff(ticks)[gap - 1] > 10 and (np.delete(np.diff(ticks), gap - 1) == 1).all()
    assert rows.t_s[gap] == pytest.approx(rows.t_s[gap - 1] + 0.01)
