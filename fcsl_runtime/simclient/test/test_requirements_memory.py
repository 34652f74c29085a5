# SPDX-License-Identifier: Apache-2.0
"""What requirements remember is in checkpoints and recordings: verdicts go on as if the flight had never stopped."""

from __future__ import annotations

import random
import struct
import zlib
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest
from requirements_oracle import Generator, written
from test_requirements import TICK_HZ, fly, machine

from simclient import AlgTwin, ProcessTwin, PyTwin, TwinError
from simclient.bag import formats
from simclient.machine_build import build_config
from simclient.replay.reproduce import Replay
from simclient.requirements import summary
from simclient.run import open_run
from simclient.twin.black_box import BlackBox

REMEMBERED = 0.1  # s
HELD = {"id": "H", "text": "held", "then": f"held(src.outputs.x < 1.5, {REMEMBERED})", "when": "machine.tick > 10"}


@pytest.fixture(scope="module")
def craft(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A machine with requirements of all kinds."""
    generator = Generator(23, TICK_HZ)
    return machine(tmp_path_factory.mktemp("craft"), [written(generator.requirement(f"R-{i}")) for i in range(30)])


@pytest.fixture(scope="module")
def held(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return machine(tmp_path_factory.mktemp("held"), [HELD], "held")


def test_a_flight_that_is_restored_has_the_verdicts_of_one_that_never_stopped(craft: Path) -> None:
    with AlgTwin.from_config(craft) as twin, AlgTwin.from_config(craft) as other, PyTwin.from_config(craft) as python:
        begin, violated = twin.save(), set[str]()
        for seed in range(8):
            before, after = random.Random(seed).choices(range(1, 90), k=2)
            twin.restore(begin)
            fly(twin, seed, before)
            saved = twin.save()
            fly(twin, seed + 100, after)
            flown = twin.requirements
            violated |= {verdict.id for verdict in flown.values() if verdict.violations}
            for restored in (other, twin, python)[: 3 if seed == 0 else 2]:
                restored.restore(saved)
                assert restored.save() == saved
                fly(restored, seed + 100, after)
                assert repr(restored.requirements) == repr(flown)  # NaNs, too
        assert len(violated) > 10


def test_a_flight_program_begins_where_a_file_ends(craft: Path, tmp_path: Path) -> None:
    with AlgTwin.from_config(craft) as twin, ProcessTwin.from_config(craft) as process:
        fly(twin, 1, 40)
        twin.save_file(tmp_path / "saved")
        process.restore_file(tmp_path / "saved")
        assert process.save() == twin.save()
        for each in (twin, process):
            fly(each, 2, 30)
        assert process.save() == twin.save()


def test_a_recording_that_begins_and_goes_back_in_a_flight_is_replayed_with_its_verdicts(
    craft: Path, tmp_path: Path
) -> None:
    with AlgTwin.from_config(craft) as twin:
        fly(twin, 3, 30)
        twin.record(tmp_path / "flight")
        saved = twin.save()
        fly(twin, 4, 30)
        twin.restore(saved)
        fly(twin, 5, 30)
        twin.stop_recording()
        flown = list(twin.requirements.values())
    bag = formats.opened(tmp_path / "flight")
    with closing(open_run(*build_config(craft))) as run:
        replay = Replay(bag, bag.machine(), run)
        assert replay.run().identical
        assert repr(run.verdicts()) == repr(flown)


def memory_of(saved: bytes) -> tuple[int, int]:
    """Begin and end of the memory of requirements, by the specification."""
    struct_bytes, entries, _, name_bytes = struct.unpack_from("<4I", saved, 40)
    return 248 + name_bytes + struct_bytes, len(saved) - 16 * entries - 4


def changed(saved: bytes, change: Callable[[bytearray, int, int], None]) -> bytes:
    content = bytearray(saved[:-4])
    change(content, *memory_of(saved))
    content[16:24] = (len(content) + 4).to_bytes(8, "little")
    return bytes(content) + zlib.crc32(content).to_bytes(4, "little")


def drop(content: bytearray, begin: int, end: int) -> None:
    """As an older program wrote it: format version 2."""
    del content[begin:end]
    content[8:12] = (2).to_bytes(4, "little")


def of_others(content: bytearray, begin: int, end: int) -> None:
    content[begin] ^= 1


@pytest.mark.parametrize("change", [drop, of_others])
def test_without_its_memory_a_requirement_begins_anew_and_says_so(
    held: Path, change: Callable[[bytearray, int, int], None]
) -> None:
    with (
        AlgTwin.from_config(held) as twin,
        AlgTwin.from_config(held) as other,
        ProcessTwin.from_config(held) as process,
    ):
        twin.tick(15)
        saved = twin.save()
        twin.tick(3)
        assert twin.requirements["H"].status == "met" and "anew" not in str(twin.requirements["H"])
        for each in (other, process):
            each.restore(changed(saved, change))
            each.tick(3)
            again = each.requirements["H"]
            assert again.violations == 1 and again.first_tick == 15  # nothing has been held for so long
            assert str(again).endswith("began anew at tick 15: the checkpoint has no memory of this requirement")
            assert summary([again])[-1].endswith("; begun anew at tick 15: the checkpoint has no memory of them")
            each.restore(saved)
            assert "anew" not in str(each.requirements["H"]) + summary([each.requirements["H"]])[-1]


def cut_short(content: bytearray, begin: int, end: int) -> None:
    del content[end - 8 : end]


def no_head(content: bytearray, begin: int, end: int) -> None:
    del content[begin + 100 : end]


def no_bool(content: bytearray, begin: int, end: int) -> None:
    """In every byte of what is remembered: a bool, an index or a state is among them."""
    content[begin + 132 : end] = b"\x7f" * (end - begin - 132)


@pytest.mark.parametrize("change", [cut_short, no_head, no_bool])
def test_damaged_memory_is_refused_and_nothing_changes(
    held: Path, change: Callable[[bytearray, int, int], None]
) -> None:
    with AlgTwin.from_config(held) as twin:
        twin.tick(15)
        saved = twin.save()
        with pytest.raises(TwinError, match="damaged: .*memory of its requirements"):
            twin.restore(changed(saved, change))
        assert twin.save() == saved


def test_a_test_that_goes_back_does_not_hide_a_violation(held: Path) -> None:
    with AlgTwin.from_config(held) as twin:
        box = BlackBox(twin)  # by which pytest judges a test
        begin = twin.save()
        twin.set("src.outputs.x", 3.0)
        twin.tick(20)
        twin.restore(begin)
        twin.tick(1)
        assert twin.requirements["H"].violations == 0
        assert [verdict.violations for verdict in box.verdicts()] == [1]
