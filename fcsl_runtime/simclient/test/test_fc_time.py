# SPDX-License-Identifier: Apache-2.0
"""fcsl-fc and time: ticks that come late, a step that hangs, signals in every phase, what the system does not allow."""

from __future__ import annotations

import contextlib
import ctypes
import json
import os
import random
import re
import resource
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from conftest import CFLAGS, ROOT
from native import FIXTURE, PROGRAM, Client, Fc, flying

from fcsl_compiler.driver.cache import build_machine

EXTERN = """
#define _GNU_SOURCE
#include "nap.h"

#include <time.h>

int64_t nap_ms(int64_t ms)
{
    const struct timespec time = {.tv_sec = ms / 1000, .tv_nsec = ms % 1000 * 1000000};
    if (ms > 0) {
        (void)nanosleep(&time, NULL);
    }
    return ms;
}
"""
NAP = '''from fcsl_builtins import extern


@extern(header="nap.h", lang="c")
def nap_ms(ms: i64) -> i64: ...


class Nap:
    """Holds up the step for a while."""

    outputs = {"ms": "i64"}
    parameters = {"wanted_ms": "i64"}

    def execute(self):
        self.ms = nap_ms(self.wanted_ms)
'''
EXECUTE_LINE = NAP[: NAP.index("def execute")].count("\n") + 1


@pytest.fixture(scope="module")
def napping(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Folder of machines `nap_<ms>` at 100 Hz: instance `hurry` never sleeps, `sleepy` does for that long in each tick."""
    folder = tmp_path_factory.mktemp("napping")
    (folder / "nap.py").write_text(NAP)
    (folder / "nap.h").write_text("#include <stdint.h>\nint64_t nap_ms(int64_t ms);\n")
    (folder / "nap.c").write_text(EXTERN)
    return folder


def nap_machine(folder: Path, ms: int) -> str:
    config = folder / f"nap_{ms}.json"
    instances = {
        name: {"algorithm": "Nap", "parameters": {"wanted_ms": n}} for name, n in (("hurry", 0), ("sleepy", ms))
    }
    machine = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {"Nap": {"source": "nap.py"}},
        "instances": instances,
        "connections": [],
        "states": {"RUN": {"schedule": {"hurry": 100, "sleepy": 100}}},
        "transitions": [],
        "targets": {"simulation": {"sources": ["nap.c"], "include": ["."]}},
    }
    config.write_text(json.dumps(machine))
    return str(build_machine(config, "simulation").library)


def last(path: Path) -> dict[str, Any]:
    state: dict[str, Any] = json.loads(path.read_text())
    return state


def announced(fc: Fc) -> None:
    """Waits until it flies."""
    assert fc.process.stdout is not None and fc.process.stdout.readline().startswith("fcsl-fc: machine")


# ---- missed deadlines


def test_catch_up_makes_every_tick(napping: Path, tmp_path: Path) -> None:
    """Each tick takes 35 ms of its 10: all of them come late, and for the first ones nothing is left out."""
    with flying("--ticks", "4", "--summary", tmp_path / "end", library=nap_machine(napping, 35)) as fc:
        code, _, err = fc.wait()
    state = last(tmp_path / "end")
    assert (code, err) == (0, "") and state["tick"] == 4 and state["ended"] == "ticks"
    assert state["counters"]["deadlines_missed"] >= 3 and state["lateness_ns"]["max"] >= 3 * 25_000_000
    assert state["lateness_ns"]["max"] < 10**11  # and none comes early, which would be a huge number here
    assert state["tick_time_ns"]["count"] == 4 and state["tick_time_ns"]["p50"] >= 35_000_000


def test_skip_makes_no_late_tick(napping: Path, tmp_path: Path) -> None:
    """During each of the first three ticks three deadlines at least pass: the newest gets the next tick, the others none."""
    options = ("--missed-deadline", "skip", "--ticks", "4", "--summary", tmp_path / "end")
    with flying(*options, library=nap_machine(napping, 35)) as fc:
        code, _, err = fc.wait()
    state = last(tmp_path / "end")
    assert (code, err) == (0, "") and state["tick"] == 4
    assert state["counters"]["deadlines_missed"] == state["counters"]["ticks_skipped"] >= 6


def test_stop_ends_the_run(napping: Path, tmp_path: Path) -> None:
    options = ("--missed-deadline", "stop", "--summary", tmp_path / "end")
    with flying(*options, library=nap_machine(napping, 35)) as fc:
        code, out, err = fc.wait()
    state = last(tmp_path / "end")
    assert code == 3 and "--missed-deadline stop ends the run before it" in err and " 1 deadlines missed" in out
    assert f"fcsl-fc: {state['ended']}\n" == err and state["tick"] <= 1


# ---- watchdog


def test_watchdog_names_the_instance(napping: Path, tmp_path: Path) -> None:
    """At most once a tick, while it hangs; and the run goes on."""
    options = ("--watchdog-ms", "300", "--ticks", "3", "--summary", tmp_path / "end")
    with flying(*options, library=nap_machine(napping, 1500)) as fc:
        code, out, err = fc.wait()
    lines = err.splitlines()
    assert code == 0 and "3 ticks" in out and 1 <= len(lines) <= 3
    assert f" {len(lines)} watchdog trips" in out and last(tmp_path / "end")["counters"]["watchdog_trips"] == len(lines)
    found = [
        re.fullmatch(r"fcsl-fc: watchdog \(300 ms\): tick (\d) has run for \d+ ms, now (.*)", line) for line in lines
    ]
    assert all(found) and len({match[1] for match in found if match}) == len(lines)
    assert f"in instance 'sleepy' (nap.py:{EXECUTE_LINE})" in {match[2] for match in found if match}


def test_watchdog_leaves_a_fast_tick_alone(napping: Path) -> None:
    with flying("--watchdog-ms", "20000", "--ticks", "20", library=nap_machine(napping, 1)) as fc:
        code, out, err = fc.wait()
    assert (code, err) == (0, "") and "0 watchdog trips" in out


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_while_a_step_hangs(napping: Path, tmp_path: Path, number: int) -> None:
    """It ends all the same, says where it hangs, and writes what the last complete tick left."""
    options = ("--watchdog-ms", "100", "--summary", tmp_path / "end")
    with flying(*options, library=nap_machine(napping, 600_000)) as fc:
        assert fc.process.stderr is not None and "watchdog" in fc.process.stderr.readline()
        code, out, err = fc.stop(number)
    state = last(tmp_path / "end")
    assert code == 4 and "0 ticks" in out and err == f"fcsl-fc: {state['ended']}\n"
    assert state["ended"].startswith("stuck: tick 0 has run for ")
    assert state["ended"].endswith(f"now in instance 'sleepy' (nap.py:{EXECUTE_LINE}); ended without it")
    assert state["tick"] == 0 and state["instances"]["sleepy"]["health"] == "stale"


def test_who_looks_is_served_while_a_command_hangs(napping: Path, tmp_path: Path) -> None:
    """Though the step thread of a paused program serves clients itself."""
    path = tmp_path / "fc.sock"
    with flying("--socket", path, "--paused", library=nap_machine(napping, 600_000)) as fc:
        ticking, looking = fc.client(path), fc.client(path)
        for _ in range(10):  # by the last one the step thread serves
            ticking.ok("pause")
            time.sleep(0.01)
        ticking.send(b'{"cmd":"tick"}\n')
        time.sleep(0.01)
        assert [looking.ok("state")["tick"] for _ in range(3)] == [0, 0, 0]
        ticking.close()
        looking.close()


# ---- signals in every phase


@pytest.fixture
def full_pipe() -> Iterator[int]:
    """The end to write to of a pipe that nobody reads, and in which there is no room."""
    reader, writer = os.pipe()
    os.set_blocking(writer, False)
    with contextlib.suppress(BlockingIOError):
        while True:
            os.write(writer, bytes(1))
    os.set_blocking(writer, True)
    yield writer
    os.close(reader)
    os.close(writer)


@pytest.mark.parametrize(("milliseconds", "code", "ended"), [(5, 0, "signal"), (600_000, 4, "stuck")])
@pytest.mark.parametrize("full", ["stdout", "stderr"])
def test_signal_while_nobody_reads_what_it_says(
    full: str, milliseconds: int, code: int, ended: str, napping: Path, full_pipe: int, tmp_path: Path
) -> None:
    """The watchdog has much to say, and so has the end: the run ends all the same, and leaves its last state."""
    options = ("--watchdog-ms", "1", "--socket", tmp_path / "s", "--summary", tmp_path / "end")
    with flying(*options, library=nap_machine(napping, milliseconds), **{full: full_pipe}) as fc:
        client = fc.client(tmp_path / "s")
        while client.ok("stats")["watchdog_trips"] == 0:
            pass
        assert fc.stop()[0] == code
    assert last(tmp_path / "end")["ended"].startswith(ended)


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize(
    "phase", [(), ("--rate", "max"), ("--paused", "--socket", "s")], ids=["paced", "free", "paused"]
)
def test_signal_in_flight(phase: tuple[str, ...], number: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    handled = signal.signal(number, signal.SIG_DFL)  # also where nohup has started the tests
    try:
        with flying(*phase, "--summary", "end", "--record", "bag") as fc:
            signal.signal(number, handled)
            announced(fc)
            code, out, err = fc.stop(number)
    finally:
        signal.signal(number, handled)
    state = last(tmp_path / "end")
    assert (code, err) == (0, "") and state["ended"] == "signal" and f"{state['counters']['ticks']} ticks" in out
    assert (tmp_path / "bag/metadata.yaml").exists() and not (tmp_path / "s").exists()
    assert not (tmp_path / "end.tmp").exists()


def test_nohup_keeps_the_hangup_away(tmp_path: Path) -> None:
    """As `nohup fcsl-fc` does: what was told to ignore SIGHUP flies on, and ends when it is asked to."""
    command = [PROGRAM, FIXTURE, "--socket", str(tmp_path / "s")]
    ignoring = ["sh", "-c", 'trap "" HUP; exec "$@"', "sh", *map(str, command)]
    with subprocess.Popen(ignoring, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        while "commands on" not in process.stdout.readline():
            assert process.poll() is None
        process.send_signal(signal.SIGHUP)
        client = Client(tmp_path / "s")
        begun = client.ok("state")["tick"]
        while client.ok("state")["tick"] < begun + 10:
            pass
        process.terminate()
        assert process.wait(20) == 0


def test_signal_while_it_waits_for_the_simulator(tmp_path: Path) -> None:
    """Nobody listens yet; the default action ends it, since there is nothing to save."""
    wire = tmp_path / "wire"
    with flying("--hal", f"wire:unix:{wire}", "--timeout", "60", "--summary", tmp_path / "end") as fc:
        with socket.socket(socket.AF_UNIX, socket.SOCK_SEQPACKET) as listener:
            listener.bind(str(wire))
            listener.listen(1)
            listener.accept()[0].close()  # it got that far
        begun = time.monotonic()
        code, _, _ = fc.stop(signal.SIGTERM)
    assert code in (-signal.SIGTERM, 1) and time.monotonic() - begun < 10 and not (tmp_path / "end").exists()


def test_signals_at_any_moment(tmp_path: Path) -> None:
    """From the first instruction to the last: it ends, and what it leaves is whole or not there."""
    numbers = random.Random(7)
    ends = []
    for i in range(25):
        end = tmp_path / f"end_{i}"
        with flying("--ticks", "3", "--summary", end, "--socket", tmp_path / "s") as fc:
            time.sleep(numbers.random() * 0.06)
            code, _, _ = fc.stop(signal.SIGTERM)
        # Killed by it before it was blocked, or ended by itself or by the signal.
        assert code in (0, -signal.SIGTERM)
        assert code != 0 or last(end)["ended"] in ("signal", "ticks")
        assert not end.exists() or last(end)["machine"] == "fixture"
        ends.append(code)
    assert 0 in ends


def test_kills_at_any_moment(tmp_path: Path) -> None:
    """The last state is the old one or the new one, whole; nothing that stays hinders the next run."""
    numbers = random.Random(8)
    end = tmp_path / "end"
    with flying("--ticks", "3", "--summary", end) as fc:
        assert fc.wait()[0] == 0
    for _ in range(25):
        with flying("--ticks", "3", "--summary", end, "--socket", tmp_path / "s") as fc:
            time.sleep(numbers.random() * 0.06)
            code, _, _ = fc.stop(signal.SIGKILL)
        assert code in (0, -signal.SIGKILL) and last(end)["tick"] == 3
    with flying("--ticks", "3", "--summary", end, "--socket", tmp_path / "s") as fc:
        assert fc.wait()[0] == 0


def test_nothing_is_printed_into_a_socket(tmp_path: Path) -> None:
    """Whoever starts it with standard input and outputs closed: none of what it opens gets their numbers."""
    path = tmp_path / "s"
    command = [PROGRAM, FIXTURE, "--socket", str(path), "--paused"]
    with subprocess.Popen(command, preexec_fn=lambda: os.closerange(0, 3)) as process:
        while not path.exists():
            assert process.poll() is None
        try:
            targets = [os.readlink(f"/proc/{process.pid}/fd/{number}") for number in range(3)]
            process.terminate()
            code = process.wait(20)
        finally:
            process.kill()
    assert targets == ["/dev/null"] * 3 and code == 0


def test_a_leash_ends_behind_what_was_written(tmp_path: Path) -> None:
    """What a parent left in the pipe does not hide its end."""
    command = [PROGRAM, FIXTURE, "--exit-on-stdin-eof", "--summary", str(tmp_path / "end")]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL) as process:
        assert process.stdin is not None
        process.stdin.write(bytes(50_000))
        process.stdin.close()
        try:
            assert process.wait(20) == 0
        finally:
            process.kill()
    assert last(tmp_path / "end")["ended"] == "signal"


# ---- the last state


def test_summary_file_is_complete(tmp_path: Path) -> None:
    end = tmp_path / "end"
    with flying("--rate", "max", "--ticks", "1000", "--summary", end) as fc:
        assert fc.wait()[0] == 0
    state = last(end)
    assert (state["machine"], state["tick"], state["state"], state["paused"]) == ("fixture", 1000, "IDLE", False)
    assert state["instances"]["pilot"] == {"health": "nominal", "faults": 0, "overruns": 0, "fault_place": ""}
    assert state["lateness_ns"] == {"count": 0, "p50": 0, "p99": 0, "p999": 0, "max": 0, "buckets": []}
    times = state["tick_time_ns"]
    assert times["count"] == 1000 == sum(n for _, n in times["buckets"])
    assert times["p50"] <= times["p99"] <= times["p999"] <= times["max"] <= times["buckets"][-1][0]


def test_summary_file_replaces_a_file_whole(tmp_path: Path) -> None:
    """The old one stays until the new one is complete, also when it cannot be written."""
    end = tmp_path / "end"
    end.write_text("old")
    os.mkdir(tmp_path / "end.tmp")  # in the way
    with flying("--rate", "max", "--ticks", "1", "--summary", end) as fc:
        code, _, err = fc.wait()
    assert code == 1 and f"cannot write '{end}'" in err and end.read_text() == "old"
    os.rmdir(tmp_path / "end.tmp")
    with flying("--rate", "max", "--ticks", "1", "--summary", end) as fc:
        assert fc.wait()[0] == 0
    assert last(end)["tick"] == 1


def test_a_recording_that_fails_does_not_end_a_flight_in_real_time(tmp_path: Path) -> None:
    """It is told while it happens, once, and by the exit status; the ticks go on."""

    def small_disk() -> None:
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)  # the write then fails with EFBIG, much like a full disk
        resource.setrlimit(resource.RLIMIT_FSIZE, (16384, 16384))  # metadata.yaml fits

    command = [PROGRAM, FIXTURE, "--record", str(tmp_path / "bag"), "--ticks", "400"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=60, check=False, preexec_fn=small_disk)
    assert result.returncode == 1 and "400 ticks" in result.stdout
    assert re.fullmatch(r"fcsl-fc: tick \d+: recording failed: .*File too large\n", result.stderr)


def test_a_limit_of_file_sizes_is_an_error_not_the_end(tmp_path: Path) -> None:
    """SIGXFSZ would end the flight for what a client asks for."""
    options = ("--socket", tmp_path / "s", "--checkpoints", tmp_path, "--summary", tmp_path / "end")
    with flying(*options) as fc:
        resource.prlimit(fc.process.pid, resource.RLIMIT_FSIZE, (100, resource.RLIM_INFINITY))
        client = fc.client(tmp_path / "s")
        assert "File too large" in client.error("save", file="x")["message"]
        assert not client.ok("state")["paused"]
        code, _, err = fc.stop()
    assert code == 1 and err == f"fcsl-fc: cannot write '{tmp_path / 'end'}': File too large\n"


def test_a_library_that_cannot_be_one_is_refused(tmp_path: Path) -> None:
    """A cut file would be a SIGBUS, a FIFO would be waited for without an end."""
    whole = Path(FIXTURE).read_bytes()
    for size in (100, len(whole) // 4, len(whole) // 2):
        (tmp_path / "cut.so").write_bytes(whole[:size])
        result = subprocess.run([PROGRAM, str(tmp_path / "cut.so")], capture_output=True, text=True, check=False)
        assert result.returncode == 1 and "cannot load machine library" in result.stderr and "cut.so" in result.stderr
    os.mkfifo(tmp_path / "fifo")
    for options in ([str(tmp_path / "fifo")], [FIXTURE, "--board", str(tmp_path / "fifo")]):
        result = subprocess.run([PROGRAM, *options], capture_output=True, text=True, check=False, timeout=30)
        assert result.returncode == 1 and "not a regular file" in result.stderr


# ---- options


@pytest.mark.parametrize(
    ("options", "code", "text"),
    [
        ("--missed-deadline never", 2, "catch-up, skip or stop, not never"),
        ("--missed-deadline skip --rate max", 2, "it does not go with --rate max"),
        ("--realtime-priority 0", 2, "from 1 to 99, not 0"),
        ("--realtime-priority 100", 2, "from 1 to 99, not 100"),
        ("--realtime-priority 50 --rate max", 2, "use --rate realtime"),
        ("--cpu -1", 2, "from 0 to 1023, not -1"),
        ("--watchdog-ms 0", 2, "from 1 to 3600000, not 0"),
        ("--record-policy never --record b", 2, "wait or drop, not never"),
        ("--record-policy drop", 2, "need --record"),
        ("--record-fields *", 2, "need --record"),
        ("--record-split seconds=1", 2, "need --record"),
        ("--record-split hours=1 --record b", 1, "split by seconds=60"),
        ("--summary /nonexistent/folder/end", 1, "cannot write '/nonexistent/folder/end': No such file"),
        ("--summary /", 1, "'/' is no name of a file to write"),
        ("--summary=", 1, "'' is no name of a file to write"),
        ("--summary", 2, "--summary"),
        ("--summary folder/", 1, "'folder/' is no name of a file to write"),
        (f"--summary {'a' * 253}", 1, "File name too long"),
        ("--summary /dev/null", 1, "not a regular file"),
    ],
)
def test_options_that_are_refused(
    options: str, code: int, text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Before anything is opened, in two lines at most."""
    monkeypatch.chdir(tmp_path)
    command = [PROGRAM, FIXTURE, *options.split()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert result.returncode == code and text in result.stderr and result.stdout == ""
    assert result.stderr.count("\n") <= 2 and not list(tmp_path.iterdir())


# ---- what the system does not allow


def unprivileged(
    *arguments: str, limit: tuple[int, int] = (resource.RLIMIT_CORE, 0)
) -> subprocess.CompletedProcess[str]:
    """fcsl-fc with one resource limited, and without the rights to exceed it, also for root."""
    drop_right, sys_nice, ipc_lock = 24, 23, 14  # PR_CAPBSET_DROP and capabilities
    libc = ctypes.CDLL(None)

    def drop() -> None:
        resource.setrlimit(limit[0], (limit[1], limit[1]))
        for right in (sys_nice, ipc_lock):
            libc.prctl(drop_right, right, 0, 0, 0)

    command = [PROGRAM, FIXTURE, "--ticks", "3", *arguments]
    return subprocess.run(command, capture_output=True, text=True, timeout=30, check=False, preexec_fn=drop)


def test_priority_needs_a_right() -> None:
    result = unprivileged("--realtime-priority", "50", limit=(resource.RLIMIT_RTPRIO, 0))
    assert result.returncode == 1 and result.stdout == ""
    assert "--realtime-priority 50 is not allowed here (the limit is 0)" in result.stderr
    assert "cap_sys_nice" in result.stderr and "limits.conf" in result.stderr


@pytest.mark.parametrize("kib", range(3072, 6144, 128))
def test_locking_at_any_limit_works_or_names_it(kib: int) -> None:
    """Near what the program needs, the stack must not grow into the limit: that would be a SIGSEGV."""
    result = unprivileged("--lock-memory", limit=(resource.RLIMIT_MEMLOCK, kib * 1024))
    assert result.returncode == 0 or (
        result.returncode == 1 and f"--lock-memory needs more than the {kib} KiB" in result.stderr
    )


def test_locking_holds_for_what_is_mapped_later(tmp_path: Path) -> None:
    """Pages that a library maps during the run: the kernel flags them as locked in smaps."""
    library = tmp_path / "librealtime.so"
    source = ROOT / "fcsl_runtime/fcsl_runtime"
    folders = (source / "src", source / "include", ROOT / "fcsl_hal/include", ROOT / "fcsl_compiler/include")
    options = [f"-I{folder}" for folder in folders]
    subprocess.run(["cc", *CFLAGS, *options, str(source / "fc/realtime.c"), "-o", str(library)], check=True)
    code = (
        "import ctypes, mmap, re\n"
        f"lib = ctypes.CDLL({str(library)!r})\n"
        "class Realtime(ctypes.Structure):\n"
        "    _fields_ = [(name, ctypes.c_int) for name in ('priority', 'lock_memory', 'cpu')]\n"
        "error = ctypes.create_string_buffer(512)\n"
        "if lib.realtime_enter(ctypes.byref(Realtime(0, 1, -1)), error): raise SystemExit(error.value.decode())\n"
        "page = mmap.mmap(-1, 16 << 20)\n"
        "start = ctypes.addressof(ctypes.c_char.from_buffer(page))\n"
        "for part in re.split(r'(?m)^(?=[0-9a-f]+-)', open('/proc/self/smaps').read())[1:]:\n"
        "    first, last = (int(a, 16) for a in part.split()[0].split('-'))\n"
        "    if first <= start < last:\n"
        "        assert ' lo' in re.search(r'VmFlags:(.*)', part)[1], part\n"
        "        break\n"
        "else:\n"
        "    raise SystemExit('no mapping')\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60, check=False)
    if "--lock-memory needs more" in done.stderr:
        pytest.skip("memory may not be locked here")
    assert done.returncode == 0, done.stderr


def test_locking_needs_a_right() -> None:
    result = unprivileged("--lock-memory", limit=(resource.RLIMIT_MEMLOCK, 65536))
    assert result.returncode == 1 and result.stdout == ""
    low = unprivileged("--lock-memory", limit=(resource.RLIMIT_STACK, 512 * 1024))
    assert low.returncode == 1 and "--lock-memory touches 512 KiB of the stack, which may have 512 KiB" in low.stderr
    assert "--lock-memory needs more than the 64 KiB" in result.stderr and "ulimit -l unlimited" in result.stderr


def test_a_processor_that_is_not_there() -> None:
    allowed = os.sched_getaffinity(0)
    absent = max(allowed) + 1
    result = unprivileged("--cpu", str(absent))
    assert result.returncode == 1 and f"--cpu {absent}: this program may run on " in result.stderr


def test_the_only_processor_is_not_for_the_step_thread_alone() -> None:
    cpu = min(os.sched_getaffinity(0))
    command = ["taskset", "-c", str(cpu), PROGRAM, FIXTURE, "--cpu", str(cpu), "--ticks", "3"]
    result = subprocess.run(command, capture_output=True, text=True, timeout=30, check=False)
    assert result.returncode == 1 and "the only processor" in result.stderr


def threads(pid: int) -> dict[int, tuple[int, set[int]]]:
    """Scheduling policy and processors of each thread."""
    found = {}
    for name in os.listdir(f"/proc/{pid}/task"):
        tid = int(name)
        found[tid] = (os.sched_getscheduler(tid), os.sched_getaffinity(tid))
    return found


@pytest.mark.skipif(len(os.sched_getaffinity(0)) < 2, reason="wants two processors")
def test_only_the_step_thread_is_pinned_and_real_time(tmp_path: Path) -> None:
    cpu = max(os.sched_getaffinity(0))
    others = os.sched_getaffinity(0) - {cpu}
    options = ["--cpu", str(cpu), "--socket", str(tmp_path / "s"), "--record", str(tmp_path / "bag")]
    real_time = subprocess.run(["chrt", "-f", "10", "true"], capture_output=True, check=False).returncode == 0
    if real_time:
        options += ["--realtime-priority", "10", "--lock-memory"]
    with flying(*options) as fc:
        announced(fc)
        found = threads(fc.process.pid)
        policy, cpus = found.pop(fc.process.pid)
        assert cpus == {cpu} and (policy & ~0x40000000) == (os.SCHED_FIFO if real_time else os.SCHED_OTHER)
        assert len(found) >= 3  # monitor, server, recorder
        assert all(rest == (os.SCHED_OTHER, others) for rest in found.values())
        locked = next(row for row in Path(f"/proc/{fc.process.pid}/status").read_text().splitlines() if "VmLck" in row)
        assert not real_time or int(locked.split()[1]) > 1000
        assert fc.stop()[0] == 0
