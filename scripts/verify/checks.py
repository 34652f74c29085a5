# SPDX-License-Identifier: Apache-2.0
"""`make verify`: the evidence of docs/evidence.md, one line a check, three checks at a time.

    python3 scripts/verify [--at-once 3] [--only WORDS]
    python3 scripts/verify NAME [--help]         one check alone; NAME is its folder, or fuzz_telemetry

The same every time. `make verify EFFORT=full` (FCSL_EFFORT) does more of everything, and lets fuzzers search for minutes. A
failure names its seed. What a check prints is in log/; of one that fails, everything is shown, and its end once more after
all others.
"""

from __future__ import annotations

import argparse
import os
import re
import signal
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO

from .shared.effort import scaled

ROOT = Path(__file__).resolve().parents[2]
LOGS = ROOT / "log"
#: Between two lines that say where a check is, seconds.
TOLD_EVERY_S = 10.0
#: What no check takes: one that hangs shall not keep the others from ending, seconds.
LIMIT_S = scaled(2400.0, 86400.0)
#: Lines of a failed check that are shown once more at the end, for whoever sees only the end of a long output.
LAST_LINES = 20
#: Exit status of a check that this computer cannot make; its last line says why.
LEFT_OUT = 77
_TESTS = "fcsl_compiler/test"
#: Files with tests that do more where FCSL_VERIFY is 1.
_LONGER = (
    "test/test_bus_faults.py",
    "fcsl_bridge/test/test_bus_parties.py",
    "fcsl_bridge/test/test_controller.py",
    "fcsl_bridge/test/test_robustness_bags.py",
    "fcsl_compiler/test/test_board_schema.py",
    "fcsl_compiler/test/test_schema.py",
    "fcsl_runtime/simclient/test/test_socket.py",
)


@dataclass(frozen=True)
class Check:
    """`label` for people; `command` of Python: a path with its arguments, or -m and a module."""

    label: str
    command: tuple[str, ...]
    environment: dict[str, str] = field(default_factory=dict)

    @property
    def log(self) -> Path:
        return LOGS / f"{re.sub('[^A-Za-z0-9]+', '-', self.label)}.txt"

    def last_lines(self, count: int) -> list[str]:
        """Of what it printed so far, without empty lines."""
        return [line for line in self.log.read_text(errors="replace").split("\n") if line.strip()][-count:]


def script(label: str, name: str, *arguments: str) -> Check:
    return Check(label, ("scripts/verify", name, *arguments))


def tests(label: str, file: str, *arguments: str, **environment: str) -> Check:
    return Check(label, ("-m", "pytest", "-q", "-s", f"{_TESTS}/{file}", *arguments), environment)


#: At EFFORT=full alone.
FULL_CHECKS = scaled(
    (),
    (
        script("mutants: tests notice small changes of the C runtime and of simclient", "mutation"),
        Check(
            "longer tests: faults on the bus and of nodes, sockets, schemas",
            ("-m", "pytest", "-q", *_LONGER),
            {"FCSL_VERIFY": "1"},
        ),
        tests(
            "elementary functions: mpmath at each of 100 000 hard points",
            "test_rounding.py",
            *("-k", "test_correctly_rounded"),
            FCSL_VERIFY="1",
        ),
        script("Ray: a campaign with a killed worker leaves the table of one process", "ray"),
    ),
)

#: First those that wait more than they compute, beside which others compute; then the longest, so that at the end no core
#: waits for one of them.
CHECKS = (
    *FULL_CHECKS,
    script("sanitizers, address and undefined: native tests, generated C", "sanitize", "--only", "address"),
    script("sanitizers, threads: native tests", "sanitize", "--only", "thread"),
    tests(
        "generated programs: compiled = CPython = oracle",
        "test_generated.py",
        *("-k", "test_programs or test_machines", "--programs", scaled("200", "20000"), "--program-seed", "2"),
    ),
    Check(
        "benchmarks: every one of make bench runs, in its smallest size",
        ("scripts/bench",),
        {"FCSL_BENCH_SIZE": "smallest"},
    ),
    tests(
        "generated programs: by Nim = CPython = oracle",
        "test_nim_backend.py",
        *("-k", "generated_ones", "--programs", scaled("400", "40000"), "--program-seed", "2"),
    ),
    script("fuzzers: every native parser, each with a seeded defect", "fuzz"),
    script("fuzzer: the receiver of telemetry, with seeded defects", "fuzz_telemetry"),
    script("EVA: no run-time error in generated C", "eva"),
    script("same bits: every example on every target and in CPython", "bits"),
    script("same bits: the simulator on every target and twice in a row", "plant_bits"),
    script("no allocation, bounded stack, no foreign call: every example's binary", "binary"),
    script("coverage: fcslc and clang agree on lines, branches and MC/DC", "coverage"),
    script("instruction bounds: what a step executes is counted and never exceeds them", "instructions"),
    tests(
        "broken programs and configs: always a diagnostic",
        "test_fuzz.py",
        *("--fuzz", scaled("250", "5000"), "--fuzz-seed", "2"),
    ),
    script("EVA: no run-time error in the codec, any bytes, with seeded defects", "codec"),
    script("EVA: no run-time error in parsers of receivers, any stream, with seeded defects", "receivers"),
    script("link layer: every state of two small ends, with seeded defects", "link"),
    script("processor in the loop: the lander's controller on a Cortex-M7", "pil"),
    script("real kernel drivers: sensors, outputs and flights in user-mode Linux", "hardware"),
    script("recordings: Foxglove's own packages read the values that rosbags reads", "foxglove"),
)


@dataclass
class Running:
    """A check under way."""

    check: Check
    output: IO[bytes]
    process: subprocess.Popen[bytes]
    started: float

    def seconds(self) -> float:
        return time.monotonic() - self.started

    def end(self) -> None:
        """Like Ctrl-C, upon which a check ends what it has started."""
        self.process.send_signal(signal.SIGINT)
        try:
            self.process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()


def say(text: str) -> None:
    print(f"fcsl: {text}", flush=True)


def start(check: Check) -> Running:
    LOGS.mkdir(exist_ok=True)
    say(f"{check.label} ...")
    output = check.log.open("wb")
    process = subprocess.Popen(
        [sys.executable, *check.command],
        cwd=ROOT,
        env={**os.environ, "PYTHONUNBUFFERED": "1", **check.environment},
        stdin=subprocess.DEVNULL,
        stdout=output,
        stderr=subprocess.STDOUT,
    )
    return Running(check, output, process, time.monotonic())


def ended(one: Running) -> bool:
    """Says how a check ended; whether it holds."""
    one.output.close()
    if one.process.returncode == 0:
        say(f"{one.check.label}: done in {one.seconds():.0f} s")
        return True
    if one.process.returncode == LEFT_OUT:
        say(f"{one.check.label}: left out: {''.join(one.check.last_lines(1))}")
        return True
    print(one.check.log.read_text(errors="replace"), flush=True)
    say(f"{one.check.label}: exit status {one.process.returncode}; all that it printed is above and in {one.check.log}")
    return False


def run_all(checks: Sequence[Check], at_once: int) -> list[Check]:
    """Those that failed. A failure does not keep the others from running."""
    waiting, running, failed = list(checks), list[Running](), list[Check]()
    told = time.monotonic()
    try:
        while waiting or running:
            while waiting and len(running) < at_once:
                running.append(start(waiting.pop(0)))
            time.sleep(0.2)
            for one in [r for r in running if r.seconds() > LIMIT_S]:
                say(f"{one.check.label}: not over after {LIMIT_S:.0f} s, ended")
                one.end()
            for one in [r for r in running if r.process.poll() is not None]:
                running.remove(one)
                if not ended(one):
                    failed.append(one.check)
            if time.monotonic() - told > TOLD_EVERY_S:
                told = time.monotonic()
                for one in running:
                    doing = "".join(one.check.last_lines(1))
                    print(f"{one.seconds():9.0f} s  {one.check.label.split(':')[0]}: {doing:.90}", flush=True)
    finally:
        for one in running:  # after Ctrl-C, which they got, too
            one.end()
    return failed


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--at-once", type=int, default=3, help="checks at a time; some wait, some use two cores alone (default 3)"
    )
    parser.add_argument("--only", action="append", metavar="WORDS", help="checks whose line holds this; more than once")
    given = parser.parse_args()
    chosen = [c for c in CHECKS if not given.only or any(words in c.label for words in given.only)]
    if not chosen:
        parser.error("no check's line holds that; the lines are:\n  " + "\n  ".join(c.label for c in CHECKS))
    try:
        failed = run_all(chosen, max(1, given.at_once))
    except KeyboardInterrupt:
        say("interrupted")
        return 130
    for check in failed:
        say(f"failed: {check.label}, {check.log}; its end:")
        print("".join(f"    {line:.200}\n" for line in check.last_lines(LAST_LINES)), end="", flush=True)
    if not failed:
        say("verified")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
