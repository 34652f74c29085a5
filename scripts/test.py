# SPDX-License-Identifier: Apache-2.0
"""The second half of `make test`: `make lint`, each package's tests by `colcon test`, and test/, whose tests cross packages. Exit
status 1 if anything failed.

    python3 scripts/test.py [BASE]    of the packages' tests only those that a change since commit BASE touches

Many tests wait, and at the end of each run some workers have nothing to do: two runs share the computer, the longest first, and
each has three workers of pytest for two cores. Packages with few tests share one run, a process each, since workers would
start for longer than they test. Tests share no port, path or ROS domain.
"""

from __future__ import annotations

import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from pathlib import Path

from changed_packages import changed_files, touched
from jobs import ROOT, Job, repeat_failures, run_all, say

AT_ONCE = 2
#: Those with many tests, the longest first; the others follow in one run.
LONGEST = ("fcsl_compiler", "simclient", "test", "fcsl_bridge", "fcsl_blocks", "fcsl_sim", "fcsl_hal")
RESULTS = ROOT / "build"
WORKSPACE_RESULTS = RESULTS / "workspace_tests.xml"
#: On one core, beside tests. `make test` has set up.
LINT = Job("lint", ("make", "-o", "setup", "lint"))
#: Upper bound of a run, seconds.
LIMIT_S = 2400.0
#: How much of the message of a failed test is shown, in lines and in characters a line.
_LINES_MAX, _CHARACTERS_MAX = 12, 300


def workers() -> list[str]:
    """Options of pytest-xdist."""
    cores = len(os.sched_getaffinity(0))
    return [f"-n{min(cores + cores // 2, 6)}", "--dist=worksteal"]


def package_job(label: str, names: Sequence[str], options: Sequence[str]) -> Job:
    """`options` are pytest's. Python packages get them by colcon, which sets PYTEST_ADDOPTS itself; the others by PYTEST_ADDOPTS. The
    space keeps an option from being taken for colcon's own."""
    line = ["colcon", "--log-base", f"log/test/{names[0]}", "test", "--packages-select", *names]
    line += ["--event-handlers", "console_direct+", "summary-", "--pytest-args", *(f" {option}" for option in options)]
    return Job(f"tests of {label}", tuple(line), {"PYTEST_ADDOPTS": " ".join(options)})


def workspace_job() -> Job:
    line = (sys.executable, "-m", "pytest", "test", f"--junitxml={WORKSPACE_RESULTS}", *workers())
    return Job("tests that cross packages", line)


def longest_first(packages: list[str]) -> list[Job]:
    names, short = [n for n in LONGEST if n in (*packages, "test")], sorted(set(packages) - set(LONGEST))
    jobs = [workspace_job() if name == "test" else package_job(name, [name], workers()) for name in names]
    return [*jobs, package_job("short packages", short, ["-n0"])] if short else jobs


def all_packages() -> list[str]:
    listed = subprocess.run(["colcon", "list", "--names-only"], cwd=ROOT, stdout=subprocess.PIPE, text=True, check=True)
    return listed.stdout.split()


def result_files() -> list[Path]:
    """JUnit's of pytest, in the place of each kind of package, and CTest's."""
    patterns = ("*/test_results/*/*.xml", "*/pytest.xml", "*/Testing/*/Test.xml", WORKSPACE_RESULTS.name)
    return sorted(file for pattern in patterns for file in RESULTS.glob(pattern))


def outcomes(root: ET.Element) -> Iterator[tuple[str, str, str]]:
    """Name, passed, failed or skipped, and why, of each test in a file. CTest's `pytest` is left out: its tests have a file of
    their own."""
    for test in root.iter("Test"):
        if test.get("Status") in ("passed", "failed") and test.findtext("Name") != "pytest":
            yield test.findtext("FullName") or "", test.get("Status", ""), ""
    for case in root.iter("testcase"):
        name = f"{case.get('classname', '')}::{case.get('name', '')}"
        wrong = [*case.findall("failure"), *case.findall("error")]
        if wrong:
            yield name, "failed", "\n".join(w.get("message") or w.text or "" for w in wrong)
        else:
            yield name, "skipped" if case.find("skipped") is not None else "passed", ""


def report_results() -> bool:
    """Says which tests failed and why, and how many did what, last. Whether none failed; a file that cannot be read has."""
    counts = {"passed": 0, "failed": 0, "skipped": 0}
    for file in result_files():
        try:
            found = list(outcomes(ET.parse(file).getroot()))
        except ET.ParseError as error:
            found = [(str(file), "failed", str(error))]
        for name, outcome, why in found:
            counts[outcome] += 1
            if outcome == "failed":
                first, *more = why.strip().splitlines()[:_LINES_MAX] or [""]
                say(f"failed: {name}: {first}"[:_CHARACTERS_MAX])
                print("".join(f"    {line}"[:_CHARACTERS_MAX] + "\n" for line in more), end="")
    print(", ".join(f"{number} {outcome}" for outcome, number in counts.items()), flush=True)
    return not counts["failed"]


def main() -> int:
    packages = all_packages()
    if len(sys.argv) > 1:
        packages = touched(ROOT, changed_files(sys.argv[1]))
        say(f"changed since {sys.argv[1]}: {' '.join(packages) or 'no package'}")
    for file in result_files():  # those of an earlier run must not count
        file.unlink()
    try:
        failed_jobs = run_all([LINT, *longest_first(packages)], AT_ONCE, LIMIT_S)
    except KeyboardInterrupt:
        say("interrupted")
        return 130
    repeat_failures(failed_jobs)
    silent = [name for name in packages if not any(RESULTS / name in file.parents for file in result_files())]
    for name in silent:  # colcon finds no fault with a package whose tests were not built
        say(f"failed: {name} left no results of tests; `make build` builds them")
    return 0 if report_results() and not failed_jobs and not silent else 1


if __name__ == "__main__":
    sys.exit(main())
