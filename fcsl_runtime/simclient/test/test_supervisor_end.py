# SPDX-License-Identifier: Apache-2.0
"""The end of a supervisor, gentle or not, is the end of its runs, and no obstacle for the next."""

from __future__ import annotations

import os
import signal
import tempfile
from collections.abc import Iterator
from pathlib import Path

import pytest
from supervising import Supervisor, build_minimal, end, is_gone, supervising, wait_until

LIBRARY = "libminimal.so"


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("root")
    build_minimal(folder)
    return folder


@pytest.fixture
def private() -> Iterator[Path]:
    """Where a supervisor has its private folder: the name is short, because sockets' names are."""
    with tempfile.TemporaryDirectory(prefix="fs") as folder:
        yield Path(folder)


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
def test_asked_to_end_it_ends_its_runs(root: Path, private: Path, number: int) -> None:
    with supervising(root, private=private) as supervisor:
        runs = [supervisor.start(LIBRARY, record=f"bag{number}"), supervisor.start(LIBRARY, paused=True)]
        assert supervisor.stop(number) == 0
        assert all(is_gone(run["pid"]) for run in runs)
        assert list(private.iterdir()) == []
        assert (root / f"bag{number}/metadata.yaml").is_file()  # the recording is complete


def test_a_run_that_the_kernel_keeps_is_not_waited_for(
    root: Path, private: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """As one that waits for a disk: no signal reaches it."""
    kept = "from simclient.supervisor import child, runs; child.Child.send = lambda *_: None"
    soon = "child.KILL_S = runs.KILL_S = runs.STOP_S = 0.1"
    with supervising(root, patch=f"{kept}; {soon}", private=private) as supervisor:
        first, second = supervisor.start(LIBRARY), supervisor.start(LIBRARY)
        try:
            at = f"/runs/{first['id']}"
            refused = supervisor.ask("DELETE", at)
            assert (refused.status, refused.code) == (504, "timeout")
            assert str(first["pid"]) in refused.json["error"]["message"]
            assert supervisor.get(at).json["status"] == "stopping"
            os.kill(first["pid"], signal.SIGKILL)
            wait_until(lambda: supervisor.get(at).json["status"] == "ended")
            assert supervisor.ask("DELETE", at).json["exit"]["status"] == -signal.SIGKILL
            assert supervisor.stop() == 0
        finally:
            end([first["pid"], second["pid"]])
    said = capfd.readouterr().err
    assert f"fcsl supervisor: run {second['id']} was sent SIGKILL" in said and said.count("SIGKILL") == 1


def test_killed_it_leaves_no_run_and_nothing_in_the_way(root: Path, private: Path) -> None:
    supervisor = Supervisor(root, private=private)
    runs = [supervisor.start(LIBRARY), supervisor.start(LIBRARY, paused=True), supervisor.start(LIBRARY, rate="max")]
    assert all(Path(run["socket"]).is_socket() for run in runs)
    (left,) = private.glob("fcsl-supervisor-*")
    assert left.stat().st_mode & 0o777 == 0o700
    port = supervisor.port
    supervisor.stop(signal.SIGKILL)
    supervisor.close()
    try:
        wait_until(lambda: all(is_gone(run["pid"]) for run in runs))
    finally:
        end([run["pid"] for run in runs])
    assert left.is_dir()
    with supervising(root, "--listen", f"tcp:127.0.0.1:{port}", private=private) as again:
        assert again.start(LIBRARY)["status"] == "running"
        (own,) = private.glob("fcsl-supervisor-*")
        assert own != left


def test_two_of_them_do_not_remove_each_others_sockets(root: Path, private: Path) -> None:
    with supervising(root, private=private) as first, supervising(root, private=private) as second:
        for supervisor in (first, second):
            run = supervisor.start(LIBRARY)
            assert supervisor.get(f"/runs/{run['id']}/health").status == 200


def test_a_port_that_is_taken(root: Path) -> None:
    with supervising(root) as supervisor, pytest.raises(AssertionError, match="status 2"):
        Supervisor(root, "--listen", f"tcp:127.0.0.1:{supervisor.port}")


def test_a_root_that_is_none(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for folder in (tmp_path / "none", tmp_path / "file"):
        with pytest.raises(AssertionError, match="status 2"):
            Supervisor(folder)
