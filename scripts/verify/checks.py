# SPDX-License-Identifier: Apache-2.0
"""`make verify`: the evidence of docs/internals/evidence.md, one line a check, three checks at a time.

    python3 scripts/verify [--at-once 3] [--only WORDS]
    python3 scripts/verify NAME [--help]         one check alone; NAME is its folder, or fuzz_telemetry

The same every time. `make verify EFFORT=full` (FCSL_EFFORT) does more of everything, and lets fuzzers search for minutes. A
failure names its seed. What a check prints is in log/; of one that fails, everything is shown, and its end once more after
all others.
"""

from __future__ import annotations

import argparse
import sys

from jobs import Job, repeat_failures, run_all, say

from .shared.effort import scaled

#: What no check takes: one that hangs shall not keep the others from ending, seconds.
LIMIT_S = scaled(2400.0, 86400.0)
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


def python(label: str, *arguments: str, **environment: str) -> Job:
    return Job(label, (sys.executable, *arguments), environment)


def script(label: str, name: str, *arguments: str) -> Job:
    return python(label, "scripts/verify", name, *arguments)


def tests(label: str, file: str, *arguments: str, **environment: str) -> Job:
    return python(label, "-m", "pytest", "-q", "-s", f"{_TESTS}/{file}", *arguments, **environment)


#: At EFFORT=full alone.
FULL_CHECKS = scaled(
    (),
    (
        script("mutants: tests notice small changes of runtime, compiler and simulator", "mutation"),
        python(
            "longer tests: faults on the bus and of nodes, sockets, schemas",
            *("-m", "pytest", "-q", *_LONGER),
            FCSL_VERIFY="1",
        ),
        tests(
            "elementary functions: mpmath at each of 100 000 hard points",
            "test_rounding.py",
            *("-k", "test_correctly_rounded"),
            FCSL_VERIFY="1",
        ),
        script("a user's own workspace: plain colcon build beside FCSL is silent and takes no example", "workspace"),
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
    script("wheel: the lander flies in empty environments, by gcc and by zig, with the bits of the workspace", "wheel"),
    python(
        "benchmarks: every one of make bench runs, in its smallest size",
        "scripts/bench",
        FCSL_BENCH_SIZE="smallest",
    ),
    tests(
        "generated programs: by Nim = CPython = oracle",
        "test_nim_backend.py",
        *("-k", "generated_ones", "--programs", scaled("200", "40000"), "--program-seed", "2"),
    ),
    script("fuzzers: every native parser, each with a seeded defect", "fuzz"),
    script("fuzzer: the receiver of telemetry, with seeded defects", "fuzz_telemetry"),
    script("EVA: no run-time error in parsers of receivers, any stream, with seeded defects", "receivers"),
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
    script("link layer: every state of two small ends, with seeded defects", "link"),
    script("processor in the loop: the lander's controller on a Cortex-M7", "pil"),
    python("firmware: the steps of its page on a Cortex-M7", "-m", "pytest", "-q", "test/test_firmware_page.py"),
    script("real kernel drivers: sensors, outputs and flights in user-mode Linux", "hardware"),
    script("recordings: Foxglove's own packages read the values that rosbags reads", "foxglove"),
)


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
        failed = run_all(chosen, max(1, given.at_once), LIMIT_S)
    except KeyboardInterrupt:
        say("interrupted")
        return 130
    repeat_failures(failed)
    if not failed:
        say("verified")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
