# SPDX-License-Identifier: Apache-2.0
"""How late a 1 kHz tick begins on a computer that is busy: fcsl-fc beside cyclictest (rt-tests), with real-time scheduling and
without. They take turns within minutes, under the same load. What is measured is the computer as much as the program: a virtual
machine whose host takes its processors away is late whatever runs on it, so the time that was taken is told, too.

python3 scripts/bench lateness [SECONDS]
"""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.cache import build_machine

from ..harness.size import sized

ROOT = Path(__file__).resolve().parents[3]
VEHICLE = ROOT / "scripts/bench/machines/vehicle/vehicle.json"
HZ = 1000
SECONDS, ROUNDS = sized((10, 3), (1, 1))
PRIORITY = 80
QUANTILES = {"p50": 0.5, "p99": 0.99, "p999": 0.999}
#: The largest latency that cyclictest keeps apart, us; later ones count as its maximum.
_LONGEST_US = 1_000_000

#: ns → how many ticks were so late; a bucket's end for fcsl-fc, whole microseconds for cyclictest.
Times = Counter[int]


def lateness(folder: Path, seconds: int = SECONDS) -> dict[str, Any]:
    """For `normal` and `real_time`: quantiles in us of `fcsl_fc` and `cyclictest`. Where real time is not allowed the latter
    mode is null, and cyclictest, which then refuses everything, is left out of the former."""
    library = build_machine(VEHICLE).library
    facts: dict[str, Any] = {"hz": HZ, "seconds": seconds * ROUNDS, **_computer()}
    modes = {"normal": False, "real_time": True}
    allowed = subprocess.run(["chrt", "-f", str(PRIORITY), "true"], capture_output=True, check=False).returncode == 0
    for mode, real_time in modes.items():
        facts[mode] = _side_by_side(folder, library, seconds, real_time, allowed) if allowed or not real_time else None
    return facts


def _side_by_side(folder: Path, library: Path, seconds: int, real_time: bool, peer: bool) -> dict[str, Any]:
    subjects: dict[str, Callable[[], Times]] = {"fcsl_fc": lambda: _fcsl_fc(folder, library, seconds, real_time)}
    if peer:
        subjects["cyclictest"] = lambda: _cyclictest(folder, seconds, real_time)
    times = {name: Times() for name in subjects}
    with _load():
        before = _taken_s()
        for number in range(ROUNDS):
            order = list(subjects) if number % 2 == 0 else list(subjects)[::-1]
            for name in order:
                times[name] += subjects[name]()
        taken = _taken_s() - before
    return {**{name: _quantiles(found) for name, found in times.items()}, "taken_by_the_host_s": round(taken, 2)}


def _fcsl_fc(folder: Path, library: Path, seconds: int, real_time: bool) -> Times:
    """cyclictest leaves out the deadlines that it missed; so does fcsl-fc here."""
    end = folder / "end.json"
    options = ["--realtime-priority", str(PRIORITY), "--lock-memory"] if real_time else []
    line = ["fcsl-fc", str(library), "--missed-deadline", "skip", "--summary", str(end), *options]
    process = subprocess.Popen(line, stdout=subprocess.DEVNULL)
    while process.poll() is None and not _takes(process.pid, signal.SIGTERM):
        time.sleep(0.01)  # a busy computer starts it late
    try:
        process.wait(seconds)
    except subprocess.TimeoutExpired:
        process.terminate()
    if process.wait(30) != 0:
        raise RuntimeError(f"`{' '.join(line)}` failed")
    facts = json.loads(end.read_text())["lateness_ns"]
    times = Times({bucket: count for bucket, count in facts["buckets"]})
    latest = max(times)
    times[facts["max"]] = times.pop(latest)  # all of the last bucket, at most 3 % off
    return times


def _takes(pid: int, number: int) -> bool:
    """Whether a process has a handler for a signal, or blocks it to wait for it."""
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    masks = [int(line.split()[1], 16) for line in lines if line.startswith(("SigCgt:", "SigBlk:"))]
    return any(mask >> (number - 1) & 1 for mask in masks)


def _cyclictest(folder: Path, seconds: int, real_time: bool) -> Times:
    end = folder / "cyclictest.json"
    options = ["-p", str(PRIORITY), "--mlockall"] if real_time else ["--policy", "other"]
    line = ["cyclictest", "-q", "-t", "1", "-i", str(1_000_000 // HZ), "-D", str(seconds), "-h", str(_LONGEST_US)]
    subprocess.run([*line, f"--json={end}", *options], stdout=subprocess.DEVNULL, timeout=seconds + 30, check=True)
    thread = json.loads(end.read_text())["thread"]["0"]
    times = Times({int(us) * 1000: count for us, count in thread["histogram"].items()})
    beyond = thread["cycles"] - times.total()
    times[thread["max"] * 1000] += beyond
    return times


def _quantiles(times: Times) -> dict[str, float]:
    """us: the smallest lateness that the share of the ticks does not exceed."""
    total = times.total()
    found = {"ticks": float(total), "max": max(times) / 1e3}
    for name, share in QUANTILES.items():
        below = 0
        for ns in sorted(times):
            below += times[ns]
            if below >= share * total:
                found[name] = ns / 1e3
                break
    return found


@contextmanager
def _load() -> Iterator[None]:
    """For every processor one process that computes without end; and messages through pipes between forty more (hackbench)."""
    spin = [[sys.executable, "-c", "while True: pass"]] * len(os.sched_getaffinity(0))
    chat = ["hackbench", "--pipe", "-g", "1", "-l", str(10**9)]
    processes = [
        subprocess.Popen(line, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL, start_new_session=True)
        for line in [*spin, chat]
    ]
    try:
        yield
    finally:
        for process in processes:
            os.killpg(process.pid, 15)
            process.wait()


def _taken_s() -> float:
    """Processor time that the host of a virtual machine did not give it though it had work, since it started."""
    return int(Path("/proc/stat").read_text().split()[8]) / os.sysconf("SC_CLK_TCK")


def _computer() -> dict[str, Any]:
    flags = Path("/proc/cpuinfo").read_text()
    return {
        "kernel": f"{os.uname().release} {os.uname().version}",
        "processors": len(os.sched_getaffinity(0)),
        "virtual": "hypervisor" in flags,
    }


def lateness_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    where = "virtual machine" if facts["virtual"] else "computer"
    rows = [(f"lateness of 1 kHz ticks, busy {where}", "p50 / p99 / p99.9 / max, µs")]
    for mode, title in (("normal", "no real time"), ("real_time", "SCHED_FIFO")):
        if facts[mode] is None:
            rows.append((f"    {title}", "not allowed here"))
            continue
        for name, label in (("fcsl_fc", "fcsl-fc"), ("cyclictest", "cyclictest")):
            f = facts[mode].get(name)
            figures = " / ".join(f"{f[key]:.0f}" for key in (*QUANTILES, "max")) if f else "not allowed here"
            rows.append((f"    {label}, {title}", figures))
        rows.append(("    taken by the host meanwhile", f"{facts[mode]['taken_by_the_host_s']:.1f} s of a processor"))
    return rows


def main() -> int:
    missing = [name for name in ("cyclictest", "hackbench", "chrt", "fcsl-fc") if shutil.which(name) is None]
    if missing:
        print(
            f"lateness: {', '.join(missing)} missing; scripts/bench/harness/setup.sh installs rt-tests", file=sys.stderr
        )
        return 1
    with tempfile.TemporaryDirectory() as name:
        facts = lateness(Path(name), int(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
    for what, figure in lateness_rows(facts):
        print(f"{what:<44}{figure:>34}")
    print(json.dumps(facts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
