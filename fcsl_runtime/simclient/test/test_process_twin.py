# SPDX-License-Identifier: Apache-2.0
"""ProcessTwin beyond what every twin does (test_twin.py): two processes, of which either may die."""

from __future__ import annotations

import errno
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import SimpleNamespace

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from kill_points import CannotTrace, calls_until_killed

from simclient import AlgTwin, TwinError
from simclient.private_folder import PrivateFolder
from simclient.twin import flight_process
from simclient.twin.process_tap import ProcessTap
from simclient.twin.process_twin import ProcessTwin


@pytest.fixture
def twin(probe: Path) -> Iterator[ProcessTwin]:
    with ProcessTwin.from_library(probe) as twin:
        yield twin


def gone(pid: int) -> bool:
    """Whether the process ends within 10 s. It may be another's child, so it is looked for."""
    deadline = time.monotonic() + 10
    while time.monotonic() < deadline:
        try:
            if Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] == "Z":
                return True
        except FileNotFoundError:
            return True
        time.sleep(0.01)
    return False


@pytest.mark.filterwarnings("ignore::simclient.OverwrittenWarning")
@settings(max_examples=15, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(st.lists(st.tuples(st.sampled_from(["tick", "set", "state", "restore"]), st.integers(0, 40)), max_size=12))
def test_it_leaves_what_an_in_process_twin_leaves(twin: ProcessTwin, probe: Path, steps: list[tuple[str, int]]) -> None:
    """Bit for bit, whatever is done to both."""
    writable = [f for f in twin.fields() if f.writable and f.type == "f64" and not f.bounded]
    with AlgTwin.from_library(probe) as other:
        twin.restore(other.save())
        kept = other.save()
        for what, number in steps:
            for each in (twin, other):
                if what == "tick":
                    each.tick(number)
                elif what == "set":
                    field = writable[number % len(writable)]
                    value = [float("nan"), float("inf"), -0.0, number / 3][number % 4]
                    each.set(field.path, [value] * field.count if field.shape else value)
                elif what == "state":
                    each.set_state(twin.machine.states[number % len(twin.machine.states)])
                else:
                    each.restore(kept)
        assert twin.snapshot() == other.snapshot()


def test_a_machine_that_crashes_takes_its_own_process_only(twin: ProcessTwin) -> None:
    os.kill(twin.pid, signal.SIGSEGV)
    assert gone(twin.pid)
    with pytest.raises(TwinError, match="the flight program died: killed by SIGSEGV"):
        twin.tick()
    with pytest.raises(TwinError, match="SIGSEGV"):
        twin.get_value("machine.tick")
    twin.close()
    with pytest.raises(TwinError, match="the twin is closed"):
        twin.tick()


def test_what_the_program_says_before_it_dies_is_in_the_error(tmp_path: Path) -> None:
    (tmp_path / "libx.so").write_bytes(b"no library")
    with pytest.raises(TwinError, match="cannot load"):
        ProcessTwin.from_library(tmp_path / "libx.so")


@pytest.mark.parametrize("read_s", [59.9, 60.1])
def test_a_library_that_never_loads_is_not_waited_for(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, read_s: float
) -> None:
    """Its constructor hangs. By a clock of the test, so that it has spoken when the time is up: in silence, or in between."""
    (tmp_path / "hang.c").write_text(
        "#include <unistd.h>\n"
        "__attribute__((constructor)) static void hang(void) {\n"
        '    if (write(2, "no such device yet\\n", 19) == 19 && write(1, "here\\n", 5) == 5)\n'
        "        for (;;) pause();\n"
        "}\n"
    )
    library = tmp_path / "libhang.so"
    subprocess.run(["cc", "-shared", "-fPIC", "-o", library, tmp_path / "hang.c"], check=True)
    now_s = iter([0.0, 0.0, read_s])
    monkeypatch.setattr(flight_process, "time", SimpleNamespace(monotonic=lambda: next(now_s)))
    told = "^the flight program did not start within 60 s: killed by SIGKILL: no such device yet$"
    with pytest.raises(TwinError, match=told):
        flight_process.FlightProcess(library, "probe")


def test_it_dies_with_its_parent_and_leaves_nothing(probe: Path, tmp_path: Path) -> None:
    script = (
        "import sys\nfrom simclient.twin.process_twin import ProcessTwin\n"
        f"twin = ProcessTwin.from_library({str(probe)!r})\nprint(twin.pid, flush=True)\nsys.stdin.read()\n"
    )
    environment = {**os.environ, "TMPDIR": str(tmp_path)}
    parent = subprocess.Popen(
        [sys.executable, "-c", script], stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=environment
    )
    assert parent.stdin is not None and parent.stdout is not None
    pid = int(parent.stdout.readline())
    assert Path(f"/proc/{pid}/exe").readlink().name == "fcsl-fc"
    parent.kill()
    parent.wait()
    parent.stdin.close()
    parent.stdout.close()
    assert gone(pid) and list(tmp_path.iterdir()) == []


def folders(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


def test_what_a_killed_process_leaves_is_taken_away(
    probe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A test's process is killed before any of its system calls while it opens a twin; the next twin begins in a clean place."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    try:
        calls = calls_until_killed(1 << 60, lambda: ProcessTwin.from_library(probe))
    except CannotTrace:
        pytest.skip("this system does not let a process trace its child")
    left = 0
    for call in range(1, calls, max(1, calls // 40)):
        assert calls_until_killed(call, lambda: ProcessTwin.from_library(probe)) <= call
        left = max(left, len(folders(tmp_path)))
    assert (
        1 <= left <= 2
    )  # some kills leave one; a child that has not become the flight program may hold it for a moment
    with ProcessTwin.from_library(probe) as twin:
        assert twin.tick() == 1 and folders(tmp_path) == []


def test_what_others_hold_stays(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The control of that: a folder that is in use, and one that is not ours to take."""
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    (tmp_path / "fcsl-twin-left").mkdir()
    (tmp_path / "elsewhere").mkdir()
    (tmp_path / "elsewhere" / "file").touch()
    (tmp_path / "fcsl-twin-link").symlink_to(tmp_path / "elsewhere")
    descriptors = len(os.listdir("/proc/self/fd"))
    with PrivateFolder("twin") as one, PrivateFolder("twin") as other:
        assert all(folder.path.is_dir() and folder.path.stat().st_mode & 0o777 == 0o700 for folder in (one, other))
        assert not (tmp_path / "fcsl-twin-left").exists() and (tmp_path / "elsewhere" / "file").exists()
    assert folders(tmp_path) == ["elsewhere", "fcsl-twin-link"]
    assert len(os.listdir("/proc/self/fd")) == descriptors


def test_a_folder_that_cannot_be_held_is_an_error(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Not tried again and again, each time with a new folder; the next one takes away what was made."""

    def refuse(*_: object) -> int:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    for made, call in enumerate(("os.open", "fcntl.flock"), start=1):
        with monkeypatch.context() as patch, pytest.raises(OSError, match="Too many open files"):
            patch.setattr(call, refuse)
            PrivateFolder("twin")
        assert len(folders(tmp_path)) == made
    PrivateFolder("twin").close()
    assert folders(tmp_path) == []


def test_too_few_files_are_one_message(probe: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(errno.EMFILE, "Too many open files")

    monkeypatch.setattr(subprocess, "Popen", refuse)
    with pytest.raises(TwinError, match="cannot start a flight program: Too many open files"):
        ProcessTwin.from_library(probe)


def test_ctrl_c_stops_it_between_two_ticks(twin: ProcessTwin, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupt(number: int, frame: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("simclient.twin.process_twin._SLICE_TICKS", 1000)
    before = signal.signal(signal.SIGALRM, interrupt)
    try:
        signal.setitimer(signal.ITIMER_REAL, 0.2)
        with pytest.raises(KeyboardInterrupt):
            twin.tick(10**12)
    finally:
        signal.signal(signal.SIGALRM, before)
    done = twin.tick(0)
    assert 0 < done < 10**12 and twin.tick() == done + 1 == twin.get_value("machine.tick")


def test_rows_of_skipped_ticks_are_not_given_as_others() -> None:
    """Not even where the process dies before the ticks that were to follow."""
    taps: list[ProcessTap] = []
    tap = ProcessTap([(0, 1), (3, 2)], 3, taps)
    for k in range(5):
        tap.take(bytes([k, 9, 9, k + 1, k + 2]))
    assert tap.rows() == 5 and tap.read(2, 3) == bytes([2, 3, 4, 3, 4, 5, 4, 5, 6]) and tap.read(5, 0) == b""
    for first, count in ((1, 1), (4, 2), (5, 1), (2, -1)):
        with pytest.raises(TwinError, match=f"rows {first} to {first + count - 1} are not kept"):
            tap.read(first, count)
    tap.skip(10)
    with pytest.raises(TwinError, match="rows 14 to 14 are not kept"):
        tap.read(14, 1)
    tap.take(bytes(5))
    assert tap.rows() == 16 and tap.read(15, 1) == bytes(3)
    tap.close()
    tap.close()
    assert taps == []


def test_many_twins_leak_nothing(probe: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    ProcessTwin.from_library(probe).close()
    descriptors = len(os.listdir("/proc/self/fd"))
    threads = len(os.listdir("/proc/self/task"))
    pids = []
    closed = []  # held, so that it is close() that returns everything, and not the garbage collector
    for _ in range(200):
        with ProcessTwin.from_library(probe) as twin:
            twin.tick()
            pids.append(twin.pid)
        closed.append(twin)
    assert len(os.listdir("/proc/self/fd")) == descriptors and len(os.listdir("/proc/self/task")) == threads
    assert not any(Path(f"/proc/{pid}").exists() for pid in pids) and list(tmp_path.iterdir()) == []


def test_it_runs_by_itself(twin: ProcessTwin) -> None:
    twin.resume()
    assert twin.running
    deadline = time.monotonic() + 10
    while twin.get_value("machine.tick") == 0 and time.monotonic() < deadline:
        time.sleep(0.005)
    with pytest.raises(TwinError, match=r"call pause\(\) before tick"):
        twin.tick()
    twin.pause()
    done = twin.tick(0)
    assert done > 0 and twin.tick() == done + 1 and twin.ticks_skipped >= 0


def test_threads_take_turns(twin: ProcessTwin) -> None:
    path = next(f.path for f in twin.fields() if f.writable and f.type == "f64" and not f.shape and not f.bounded)

    failures: list[BaseException] = []

    def work() -> None:
        try:
            for _ in range(50):
                twin.tick()
                twin.set(path, 1.5)
                assert twin.get_value("machine.tick") > 0
        except BaseException as error:
            failures.append(error)

    threads = [threading.Thread(target=work, daemon=True) for _ in range(4)]
    for thread in threads:
        thread.start()
    deadline = time.monotonic() + 60
    for thread in threads:
        thread.join(max(0.0, deadline - time.monotonic()))
    if any(thread.is_alive() for thread in threads):  # one waits for a reply that another has read
        os.kill(twin.pid, signal.SIGKILL)
        pytest.fail("threads wait for each other's replies")
    assert failures == [] and twin.tick() == 201


@pytest.mark.parametrize(
    "use", [lambda twin: twin.hardware.gpio[1024], lambda twin: twin.fault("nobody"), lambda twin: twin.tick(-1)]
)
def test_what_is_refused(twin: ProcessTwin, use: Callable[[ProcessTwin], object]) -> None:
    with pytest.raises(TwinError):
        use(twin)
    twin.close()
    twin.close()


def test_a_machine_of_any_size(tmp_path: Path) -> None:
    """1 MB: more than a reply of the variable server or a request to it holds."""
    (tmp_path / "large.py").write_text(
        'class Large:\n    state = {"a": "f64[65536]", "b": "f64[65536]"}\n\n    def execute(self):\n        self.a[0] += 1.0\n'
    )
    (tmp_path / "big.json").write_text(
        json.dumps(
            {
                "tick_hz": 100,
                "initial_state": "S",
                "algorithms": {"Large": {"source": "large.py"}},
                "instances": {"large": {"algorithm": "Large"}},
                "states": {"S": {"schedule": {"large": 100}}},
            }
        )
    )
    with ProcessTwin.from_config(tmp_path / "big.json") as twin, AlgTwin.from_config(tmp_path / "big.json") as alone:
        for each in (twin, alone):
            each.set("large.state.b[65535]", 7.0)
            each.tick(3)
        saved = twin.save()
        assert saved == alone.save() and len(saved) > 1_000_000
        with twin.trace("large.state.a[0]") as trace:
            twin.tick(2)
        assert list(trace["large.state.a[0]"]) == [4.0, 5.0]
        twin.restore(saved)
        assert twin.save() == saved and twin.get_value("large.state.b[65535]") == 7.0
