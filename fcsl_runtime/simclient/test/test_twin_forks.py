# SPDX-License-Identifier: Apache-2.0
"""A twin in a process that is forked: its bag, its flight program and its leash stay the parent's."""

from __future__ import annotations

import os
import time
import traceback
from collections.abc import Callable
from pathlib import Path

import pytest

from simclient import AlgTwin, ProcessTwin, Twin, TwinError
from simclient.fork_safety import FORKED
from simclient.replay import replay


def in_a_child(action: Callable[[], object]) -> None:
    """What fails there fails here."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            action()
            status = 0
        except BaseException:
            traceback.print_exc()
        finally:
            os._exit(status)
    assert os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) == 0


def refused(action: Callable[[], object]) -> None:
    with pytest.raises(TwinError, match=FORKED):
        action()


@pytest.mark.parametrize("kind", [AlgTwin, ProcessTwin])
def test_the_bag_stays_the_parents(kind: type[Twin], probe: Path, tmp_path: Path) -> None:
    with kind.from_library(probe) as twin:
        twin.record(tmp_path / "bag")
        twin.tick(100)

        def child() -> None:
            refused(lambda: twin.tick(10))
            refused(lambda: twin.get_value("machine.tick"))
            refused(twin.stop_recording)
            twin.close()

        in_a_child(child)
        twin.tick(100)
    verdict = replay(tmp_path / "bag", library=str(probe))
    assert verdict.identical and verdict.ticks == 200, str(verdict)


def test_a_twin_that_does_not_record_is_copied(probe: Path, tmp_path: Path) -> None:
    with AlgTwin.from_library(probe) as twin:
        twin.record(tmp_path / "bag")
        twin.stop_recording()
        twin.tick(5)

        def child() -> None:
            assert twin.tick(2) == 7
            twin.close()

        in_a_child(child)
        assert twin.tick(1) == 6


def test_a_child_does_not_move_the_parents_process(probe: Path) -> None:
    with ProcessTwin.from_library(probe) as twin:
        twin.tick(5)

        def child() -> None:
            refused(lambda: twin.tick(2))
            refused(twin.save)
            twin.close()
            with ProcessTwin.from_library(probe) as own:
                assert own.tick(3) == 3

        in_a_child(child)
        assert twin.tick(1) == 6


def test_a_child_that_lives_on_does_not_hold_the_leash(probe: Path) -> None:
    """The parent here is a child of the test: it is killed while its own child lives, and its flight program ends."""
    told, tell = os.pipe()
    parent = os.fork()
    if parent == 0:
        try:
            twin = ProcessTwin.from_library(probe)
            grandchild = os.fork()
            if grandchild == 0:
                time.sleep(60)
                os._exit(0)
            os.write(tell, f"{twin.pid} {grandchild}".encode())
            time.sleep(60)
        finally:
            os._exit(1)
    flight, grandchild = map(int, os.read(told, 100).split())
    os.close(tell)
    os.close(told)
    os.kill(parent, 9)
    os.waitpid(parent, 0)
    deadline = time.monotonic() + 10
    while alive(flight) and time.monotonic() < deadline:
        time.sleep(0.01)
    ended, left = not alive(flight), alive(grandchild)
    os.kill(grandchild, 9)
    assert ended and left


def alive(pid: int) -> bool:
    """Whether it runs; one that nobody has waited for does not."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False
