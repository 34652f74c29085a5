# SPDX-License-Identifier: Apache-2.0
"""A board of three inertial sensors at 1 kHz and a machine at 1 kHz: how regularly devices are sampled, beside cyclictest in the same
minutes; how old a sample is when the step takes it; how long a command takes to the output device; what all of it costs.

The devices are files in memory that the driver `iio` reads, so what is measured is FCSL and the scheduler, not a bus.

python3 scripts/bench board [SECONDS]
"""

from __future__ import annotations

import json
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter, defaultdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from fcsl_compiler.driver.cache import build_machine
from simclient.bag import Bag

from ..harness.size import sized

HZ = 1000
IMUS = ("top", "middle", "bottom")
SECONDS, ROUNDS = sized((5, 3), (1, 1))
#: The newest writes that the driver `log` keeps.
LINES, LINE_BYTES = 4096, 256
ALGORITHM = '''class Count:
    """Commands the number of its tick."""

    inputs = {"gyro": "f64[3] rad/s", "accel": "f64[3] m/s^2", "tick": "u64"}
    outputs = {"count": "f64", "armed": "bool"}

    def execute(self):
        self.count = f64(self.tick) + 0.0 * (self.gyro[0] + self.accel[0])
        self.armed = True
'''
MACHINE = {
    "tick_hz": HZ,
    "initial_state": "RUN",
    "algorithms": {"Count": {"source": "count.py"}},
    "instances": {"count": {"algorithm": "Count"}},
    "connections": [{"from": "machine.tick", "to": "count.tick"}],
    "states": {"RUN": {"schedule": {"count": HZ}}},
    "channels": [
        {"name": "gyro", "id": 1, "field": "count.inputs.gyro", "direction": "sensor", "max_age_ticks": 20},
        {"name": "accel", "id": 2, "field": "count.inputs.accel", "direction": "sensor", "max_age_ticks": 20},
        {"name": "count", "id": 3, "field": "count.outputs.count", "direction": "actuator", "safe": 0.0},
    ],
    "arm": "count.armed",
    "command_timeout_s": 0.5,
}
BOARD = {
    "machine": "count.json",
    "devices": {name: {"driver": "iio", "device": name, "rate_hz": HZ} for name in IMUS}
    | {"output": {"driver": "log", "device": "LOG"}},
    "sensors": {
        "imu": {
            "kind": "inertial",
            "channels": {"gyro": "gyro", "accel": "accel"},
            "backends": [{"device": name} for name in IMUS],
            "low_pass_hz": {"gyro": 100, "accel": 50},
        }
    },
    "outputs": {
        "count": {"device": "output", "elements": [{"signal": "number", "command": [0, 1e6], "output": [0, 1e6]}]}
    },
}

Microseconds = NDArray[np.float64]


def board_times(folder: Path, seconds: int = SECONDS) -> dict[str, Any]:
    """Quantiles in us: `interval` of samples (distance from 1 ms) beside those of `cyclictest`, `age` of the newest sample of a device
    at the tick, `output` from the tick to the device; `processor`: percent of one, of the flight program and of the guard."""
    environment = _devices(folder)
    found: dict[str, list[Microseconds]] = defaultdict(list)
    processor = []
    for number in range(ROUNDS):
        work = folder / str(number)
        work.mkdir()
        fly = lambda where=work: processor.append(_fly(where, folder, environment, seconds, found))  # noqa: E731
        turns = [fly, lambda where=work: found["cyclictest"].append(_cyclictest(where, seconds))]
        for turn in turns if number % 2 == 0 else turns[::-1]:
            turn()
    facts: dict[str, Any] = {name: _quantiles(np.concatenate(values)) for name, values in found.items()}
    return facts | {
        "imus": len(IMUS),
        "hz": HZ,
        "processor": {k: float(np.mean([p[k] for p in processor])) for k in processor[0]},
    }


def _devices(folder: Path) -> dict[str, str]:
    """The files, and an environment in which they are the kernel's."""
    for number, name in enumerate(IMUS):
        device = folder / f"sys/bus/iio/devices/iio:device{number}"
        device.mkdir(parents=True)
        files = {"name": name, "in_anglvel_scale": "0.001", "in_accel_scale": "0.01", "in_temp_raw": "25000"}
        files |= {f"in_{kind}_{axis}_raw": "12" for kind in ("anglvel", "accel") for axis in "xyz"}
        for file, text in files.items():
            (device / file).write_text(f"{text}\n")
    (folder / "count.py").write_text(ALGORITHM)
    (folder / "count.json").write_text(json.dumps(MACHINE))
    return {**os.environ, "FCSL_SYSFS": str(folder / "sys")}


def _fly(
    work: Path, folder: Path, environment: dict[str, str], seconds: int, found: dict[str, list[Microseconds]]
) -> dict[str, float]:
    library = build_machine(folder / "count.json", "simulation").library
    board = json.loads(json.dumps(BOARD).replace("LOG", str(work / "output")))
    (folder / "board.json").write_text(json.dumps(board))
    subprocess.run(["fcslc", "board", folder / "board.json"], check=True, capture_output=True)
    plan, slot = folder / "board.plan", work / "slot"
    line = ["fcsl-guard", str(library), "--slot", str(slot), "--board", str(plan)]
    guard = subprocess.Popen(line, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        while not slot.exists():
            time.sleep(0.01)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        line = ["fcsl-fc", str(library), "--hal", f"linux:{plan}", "--guard", str(slot), "--record", str(work / "bag")]
        line += ["--ticks", str(seconds * HZ)]
        subprocess.run(line, env=environment, stdout=subprocess.DEVNULL, check=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        guard_s = sum(map(int, Path(f"/proc/{guard.pid}/stat").read_text().split()[13:15])) / os.sysconf("SC_CLK_TCK")
    finally:
        guard.terminate()
        guard.wait(30)
    begun_ns = _read_bag(work / "bag", found)
    found["output"].append(_output_times(work / "output", begun_ns))
    used_s = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    return {"fcsl_fc": 100 * used_s / seconds, "fcsl_guard": 100 * guard_s / seconds}


def _read_bag(path: Path, found: dict[str, list[Microseconds]]) -> dict[int, int]:
    """Intervals and ages; returns when each tick began, ns."""
    bag, begun_ns = Bag(path), dict[int, int]()
    samples: dict[int, list[int]] = defaultdict(list)
    ages = []
    for topic, _, data in bag.messages({"/readings"}):
        message = bag.decode(topic, data)
        begun_ns[message.tick] = message.now_ns
        newest: dict[int, int] = {}
        for reading in message.readings:
            samples[reading.backend].append(reading.sample_ns)
            newest[reading.backend] = reading.sample_ns
        ages += [message.now_ns - sample_ns for sample_ns in newest.values()]
    for times_ns in samples.values():
        found["interval"].append(np.abs(np.diff(np.array(times_ns)) - 1e9 / HZ) / 1e3)
    found["age"].append(np.array(ages) / 1e3)
    return begun_ns


def _output_times(log: Path, begun_ns: dict[int, int]) -> Microseconds:
    """From the beginning of a tick to the first write of its command; of the last writes, which the log has kept."""
    first: dict[int, int] = {}
    for line in log.read_bytes().split(b"\n"):
        words = line.split()
        if len(words) == 2 and words[1].startswith(b"number="):
            tick, time_ns = round(float(words[1][7:])), int(words[0])
            first[tick] = min(time_ns, first.get(tick, time_ns))
    oldest = min(first)  # its first write may be overwritten
    return np.array([t - begun_ns[k] for k, t in first.items() if k in begun_ns and k > oldest]) / 1e3


def _cyclictest(work: Path, seconds: int) -> Microseconds:
    """Lateness of an ordinary thread that wakes every ms."""
    end = work / "cyclictest.json"
    line = ["cyclictest", "-q", "-t", "1", "-i", str(1_000_000 // HZ), "-D", str(seconds), "-h", "1000000"]
    line += ["--policy", "other", f"--json={end}"]
    subprocess.run(line, stdout=subprocess.DEVNULL, timeout=seconds + 30, check=True)
    counts = Counter({int(us): n for us, n in json.loads(end.read_text())["thread"]["0"]["histogram"].items()})
    return np.repeat(np.array(list(counts), dtype=float), list(counts.values()))


def _quantiles(values: Microseconds) -> dict[str, float]:
    p50, p99, p999 = np.quantile(values, (0.5, 0.99, 0.999))
    return {"p50": float(p50), "p99": float(p99), "p999": float(p999), "max": float(values.max()), "count": len(values)}


def board_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = [(f"board: {facts['imus']} inertial sensors and a machine at 1 kHz", "p50 / p99 / p99.9 / max, µs")]
    for name, label in (
        ("interval", "intervals of samples, from 1 ms"),
        ("cyclictest", "cyclictest, lateness"),
        ("age", "age of a sample at the step"),
        ("output", "from the tick to the output device"),
    ):
        f = facts[name]
        rows.append((f"    {label}", " / ".join(f"{f[key]:.0f}" for key in ("p50", "p99", "p999", "max"))))
    for name, label in (("fcsl_fc", "fcsl-fc"), ("fcsl_guard", "fcsl-guard")):
        rows.append((f"    processor, {label}", f"{facts['processor'][name]:.1f} % of one"))
    return rows


def main() -> int:
    missing = [name for name in ("cyclictest", "fcsl-fc") if shutil.which(name) is None]
    if missing:
        print(f"board: {', '.join(missing)} missing; scripts/bench/harness/setup.sh installs rt-tests", file=sys.stderr)
        return 1
    with tempfile.TemporaryDirectory(dir="/dev/shm") as name:
        facts = board_times(Path(name), int(sys.argv[1]) if len(sys.argv) > 1 else SECONDS)
    for what, figure in board_rows(facts):
        print(f"{what:<56}{figure:>34}")
    print(json.dumps(facts))
    return 0


if __name__ == "__main__":
    sys.exit(main())
