# SPDX-License-Identifier: Apache-2.0
"""Coverage-guided fuzzers on the receiver of telemetry: libFuzzer by atheris on harnesses/, which say what must hold.

Each of the defects below is seeded in a copy of the package and must be found, so that a harness that feeds or checks
nothing cannot pass. An input that fails ends in out/verify/fuzz/<harness>/: it becomes a test once it is fixed.
"""

from __future__ import annotations

import argparse
import os
import shutil
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

from ..shared.cases import ROOT, CheckFailed, write_facts
from ..shared.effort import scaled
from .main import CORPUS, FOLDER, HARNESSES, Run, fuzz, passes, tail
from .targets import Defect, Target

_PACKAGE = "fcsl_runtime/simclient/simclient"
#: Inputs that a seeded defect may take to be found: a number, since a time would depend on how busy the computer is.
CONTROL_INPUTS = 30_000


def _defect(module: str, text: str, instead: str) -> Defect:
    return Defect(f"{_PACKAGE}/telemetry/{module}.py", text, instead)


#: Of each harness what is wrong in words, and in the source.
DEFECTS = {
    "telemetry": {
        "what waits is not bounded": _defect(
            "collector",
            "while len(self._waiting) > WAITING_MAX or self._waiting_bytes > WAITING_BYTES_MAX:",
            "while False:",
        ),
        "configurations are not bounded": _defect(
            "assembly", "while len(self._held) > self._packets_max or self._bytes > self._bytes_max:", "while False:"
        ),
        "a stranger takes over at once": _defect(
            "collector", "if self.stream is None or self._silent(self.stream, now_s):", "if True:"
        ),
        "a row that is overwritten counts as held": _defect(
            "ring", "return sequence <= self.newest - self.rows", "return sequence < self.newest - self.rows"
        ),
        "a damaged datagram is taken": _defect("datagram", " or crc != checksum(raw)", ""),
    },
    "telemetry_configuration": {
        "bytes may be left over": _defect(
            "configuration", "_demand(offset == body_bytes and cursor.at == len(body))", ""
        ),
        "text may be no UTF-8": _defect(
            "configuration",
            "except (_Contradiction, struct.error, UnicodeDecodeError):",
            "except (_Contradiction, struct.error):",
        ),
        "a type may have any number": _defect("configuration", "number < len(TYPE_NAMES) and rank", "rank"),
    },
}
TARGETS = (
    Target(
        "telemetry",
        "datagrams of telemetry",
        "UDP",
        next(iter(DEFECTS["telemetry"].values())),
        longest=600,
        inputs=4_000,
    ),
    Target(
        "telemetry_configuration",
        "configurations of telemetry",
        "UDP",
        next(iter(DEFECTS["telemetry_configuration"].values())),
        longest=600,
        inputs=100_000,
    ),
)


def package(defect: Defect | None, folder: Path) -> Path:
    """Where simclient is imported from: the workspace, or a copy with the defect in `folder`. Raises CheckFailed."""
    if defect is None:
        return (ROOT / _PACKAGE).parent
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(ROOT / _PACKAGE, folder / "simclient", ignore=shutil.ignore_patterns("__pycache__"))
    changed = folder / Path(defect.source).relative_to(Path(_PACKAGE).parent)
    text = changed.read_text()
    if text.count(defect.text) != 1:
        raise CheckFailed(
            f"{defect.source} does not hold `{defect.text}` once: seed another defect in fuzz/telemetry.py"
        )
    changed.write_text(text.replace(defect.text, defect.instead))
    return folder


def program(target: Target, name: str, defect: Defect | None) -> Path:
    """The harness as a command, on the package with this defect."""
    folder = FOLDER / target.name
    folder.mkdir(parents=True, exist_ok=True)
    path = package(defect, folder / f"{name}.package")
    made = folder / name
    command = f'"{sys.executable}" "{HARNESSES}/{target.name}.py" -len_control=0'
    made.write_text(f'#!/bin/sh\nPYTHONPATH="{path}:$PYTHONPATH" exec {command} "$@"\n')
    made.chmod(0o755)
    return made


def check(target: Target, inputs: int, seconds: int) -> tuple[Run, dict[str, Run]]:
    """The receiver as it is, and with each defect. Raises CheckFailed."""
    folder, seeds = FOLDER / target.name, CORPUS / target.name
    sound = program(target, "program", None)
    found = fuzz(target, sound, inputs, seconds, seeds, folder / "found")
    if found.crash is not None:
        again = f"cd {folder} && ./program {found.crash}"
        raise CheckFailed(f"{target.name}: {found.reason}\n  reproduce: {again}\n{tail(found.text)}")
    if found.executions < 100:
        raise CheckFailed(f"{target.name}: only {found.executions} inputs\n{tail(found.text)}")
    rate = found.executions / max(found.seconds, 0.001)
    print(f"{target.name:24} {found.executions} inputs, {rate:.0f}/s, {found.features} features", flush=True)
    controls = {}
    for number, (what, defect) in enumerate(DEFECTS[target.name].items()):
        name = f"defect_{number}"
        run = fuzz(target, program(target, name, defect), CONTROL_INPUTS, 0, seeds, folder / f"{name}.found")
        if run.crash is None or not run.crash.is_file():  # without an input it has only failed to run
            raise CheckFailed(f"{target.name}: '{what}' was not found in {CONTROL_INPUTS} inputs\n{tail(run.text)}")
        if not passes(target, sound, run.crash):
            raise CheckFailed(f"{target.name}: what was found with '{what}' fails without it, too: {run.reason}")
        print(f"{target.name:24} {what}: found after {run.seconds:.1f} s: {run.reason[:90]}", flush=True)
        controls[what] = run
    return found, controls


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument(
        "--seconds", type=int, help="search with each harness for so long (default: as FCSL_EFFORT says)"
    )
    parser.add_argument("--only", action="append", choices=[t.name for t in TARGETS], help="this harness")
    at_once = min(2, len(os.sched_getaffinity(0)))
    parser.add_argument("--jobs", type=int, default=at_once, help=f"harnesses at a time (default {at_once})")
    options = parser.parse_args()
    targets = [t for t in TARGETS if not options.only or t.name in options.only]
    seconds = options.seconds or scaled(0, 300)
    try:
        with ThreadPoolExecutor(options.jobs) as pool:
            results = list(pool.map(lambda t: check(t, 0 if seconds else t.inputs, seconds), targets))
    except CheckFailed as error:
        print(f"fuzz_telemetry: {error}", file=sys.stderr)
        return 1
    rows = []
    print(f"\n{'bytes are':28} {'s':>5} {'inputs':>9} {'per s':>7} {'features':>8}  defects found after, s")
    for target, (found, controls) in zip(targets, results, strict=True):
        rate = round(found.executions / max(found.seconds, 0.001))
        after = {what: round(run.seconds, 1) for what, run in controls.items()}
        shown = " ".join(map(str, after.values()))
        print(f"{target.what:28} {found.seconds:5.0f} {found.executions:9} {rate:7} {found.features:8}  {shown}")
        rows.append(
            {
                "parser": target.name,
                "what": target.what,
                "seconds": round(found.seconds, 1),
                "inputs": found.executions,
                "inputs_per_s": rate,
                "features": found.features,
                "defects_found_s": after,
            }
        )
    if len(rows) == len(TARGETS):
        write_facts("fuzz_telemetry", {"parsers": rows})
    return 0


if __name__ == "__main__":
    sys.exit(main())
