# SPDX-License-Identifier: Apache-2.0
"""Twins of the lander: ticks per second from Python, one by one and many at once, beside the bare step called in C.

python3 scripts/bench twin
"""

from __future__ import annotations

import ctypes
import statistics
import subprocess
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.toolchain import FLAGS, compiler, include_dirs
from simclient import AlgTwin, PyTwin
from simclient.twin.black_box import BlackBox

from ..harness.size import sized

HERE = Path(__file__).resolve().parent
CONFIG = HERE.parents[2] / "examples/lander/fc/lander_control.json"
ROUNDS = sized(31, 2)
#: Ticks of one round, so that each takes some milliseconds.
SINGLE, MANY, PYTHON = sized((5_000, 100_000, 20), (100, 1000, 2))


def _loop(folder: Path) -> Any:
    """twin_loop of twin.c."""
    library = folder / "twin.so"
    includes = [f"-I{d}" for d in include_dirs()]
    subprocess.run([*compiler(), *FLAGS, "-shared", *includes, str(HERE / "twin.c"), "-o", str(library)], check=True)
    function = ctypes.CDLL(str(library)).twin_loop
    function.argtypes, function.restype = [ctypes.c_void_p, ctypes.c_void_p, ctypes.c_uint64], None
    return function


def _one_by_one(twin: AlgTwin, ticks: int) -> None:
    for _ in range(ticks):
        twin.tick()


def _per_s(work: Callable[[], object], ticks: int) -> float:
    begun = time.perf_counter()
    work()
    return ticks / (time.perf_counter() - begun)


def twin_times() -> dict[str, dict[str, float]]:
    """Ticks per second: median, quartiles and best of rounds that take turns."""
    with (
        tempfile.TemporaryDirectory() as name,
        AlgTwin.from_config(CONFIG) as twin,
        AlgTwin.from_config(CONFIG) as bare,
        AlgTwin.from_config(CONFIG) as traced,
        AlgTwin.from_config(CONFIG) as boxed,
        PyTwin.from_config(CONFIG) as python,
    ):
        loop = _loop(Path(name))
        BlackBox(boxed)
        descriptor, memory = ctypes.addressof(bare._run.descriptor()), bare._run.address

        def trace(*paths: str) -> None:
            with traced.trace(*paths):
                traced.tick(MANY)

        works: dict[str, tuple[Callable[[], object], int]] = {
            "single": (lambda: _one_by_one(twin, SINGLE), SINGLE),
            "single_boxed": (lambda: _one_by_one(boxed, SINGLE), SINGLE),
            "many": (lambda: twin.tick(MANY), MANY),
            "loop": (lambda: loop(descriptor, memory, MANY), MANY),
            "traced": (lambda: trace("filter.outputs", "machine.state"), MANY),
            "traced_all": (trace, MANY),
            "python": (lambda: python.tick(PYTHON), PYTHON),
        }
        found: dict[str, list[float]] = {name: [] for name in works}
        for _ in range(ROUNDS):
            for what, (work, ticks) in works.items():
                found[what].append(_per_s(work, ticks))
        found["ratio"] = [many / bare for many, bare in zip(found["many"], found["loop"], strict=True)]
    return {what: _summary(values) for what, values in found.items()}


def _summary(values: list[float]) -> dict[str, float]:
    low, middle, high = statistics.quantiles(values, n=4)
    return {"median": middle, "low": low, "high": high, "best": max(values)}


def twin_rows(facts: dict[str, dict[str, float]]) -> list[tuple[str, str]]:
    def per_s(what: str, goal: str = "") -> str:
        return f"{facts[what]['median']:,.0f} ticks/s{goal}".replace(",", " ")

    ratio = facts["ratio"]
    return [
        ("twin, one tick() after another", per_s("single", " (goal 300 000)")),
        ("    with a black box (the fixture `fcsl`)", per_s("single_boxed")),
        ("twin, tick(n)", per_s("many")),
        ("    ÷ the bare step called in C", f"{ratio['median']:.2f} ({ratio['low']:.2f} to {ratio['high']:.2f})"),
        ("    outputs of one instance and the state traced", per_s("traced")),
        ("    all fields traced (1 kB per tick)", per_s("traced_all")),
        ("PyTwin, tick(n)", per_s("python")),
    ]


if __name__ == "__main__":
    times = twin_times()
    for title, figure in twin_rows(times):
        print(f"{title:<50}{figure:>34}")
    print(
        f"best of {ROUNDS} rounds: {times['single']['best']:.0f} single ticks/s, {times['many']['best']:.0f} with tick(n)"
    )
