# SPDX-License-Identifier: Apache-2.0
"""Linear algebra as fcslc compiles it: Kalman filters of 6, 9 and 15 states and an attitude controller, beside CasADi, Eigen,
Numba, NumPy and CPython. Every peer computes the same from the same inputs, the algorithm's own file in CPython the same bits, or
there is no figure.

    python3 scripts/bench linear [--rounds N]        needs scripts/bench/harness/setup.sh
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.driver.library import emit
from fcsl_compiler.driver.toolchain import FLAGS, compiler, include_dirs
from simclient import PyTwin

from ...harness.size import sized
from ...peers.linear import casadi as linear_casadi
from ...peers.linear.model import (
    GAINS,
    INERTIA,
    STEPS,
    Matrix,
    attitude_inputs,
    attitude_numpy,
    kalman_inputs,
    kalman_model,
    kalman_numpy,
)
from ...peers.linear.numba import attitude_numba, kalman_numba

HERE = Path(__file__).resolve().parent
#: The C of others, and what every kernel is called through (kernel.h).
PEERS = HERE.parents[1] / "peers/linear"
SIZES = sized((6, 9, 15), (6,))
ROUNDS = sized(61, 1)
#: FCSL's own flags; peers get them with the contraction and the reassociation that they ship with (none).
PORTABLE = list(FLAGS)
NATIVE = [*FLAGS, "-march=native"]
#: A smallest run builds none for this processor alone.
BUILDS = sized((("", PORTABLE), (", native", NATIVE)), (("", PORTABLE),))
CXX = [f.replace("c11", "c++17") for f in FLAGS if f != "-ffp-contract=off"]
#: Beyond this the peers do not compute the same; they sum in other orders.
MAX_APART = 1e-9
#: Steps of the twin in CPython, which takes milliseconds for each.
TWIN_STEPS = sized(50, 3)
#: Goals of filters with constant matrices.
_OF_CASADI = {"kalman 6": 0.9, "kalman 9": 0.8, "kalman 15": 0.6}
AT_RUN_TIME = {"kalman": "matrices set at run time", "attitude": "parameters set at run time"}

Figures = dict[str, float]


def linear_times(folder: Path, rounds: int = ROUNDS) -> dict[str, Figures]:
    """ns per step of every peer, by table: `kalman 9`, …, `attitude`."""
    folder.mkdir(exist_ok=True)
    program = folder / "timing"
    _run([*compiler(), "-O2", "-D_GNU_SOURCE", f"-I{PEERS}", str(HERE / "timing.c"), "-ldl", "-o", str(program)])
    found: dict[str, Figures] = {}
    for n in SIZES:
        _say(f"the Kalman filter of {n} states, compiled by everyone and timed…")
        found[f"kalman {n}"] = _kalman(n, _folder(folder, f"kalman{n}"), program, rounds)
    _say("the attitude controller…")
    found["attitude"] = _attitude(_folder(folder, "attitude"), program, rounds)
    return found


def _kalman(n: int, folder: Path, program: Path, rounds: int) -> Figures:
    model, inputs = kalman_model(n), kalman_inputs()
    arrays = [
        f"static const double model_{k}[] = {{{', '.join(map(repr, v.ravel().tolist()))}}};" for k, v in model.items()
    ]
    (folder / "model.h").write_text("\n".join([f"enum {{ N = {n} }};", *arrays, ""]))
    linear_casadi.kalman(model, folder)
    source = (HERE / "algorithms" / "kalman.py").read_text().replace("N = 9", f"N = {n}")
    parameters = {k: v.tolist() for k, v in model.items()}
    frozen = _machine(_folder(folder, "frozen"), "filter", "Kalman", source, parameters, True)
    free = _machine(_folder(folder, "free"), "filter", "Kalman", source, parameters, False)
    kernels: dict[str, Path] = {}
    for label, flags in BUILDS:
        kernels |= {
            f"FCSL{label}": _fcsl(frozen, "kalman", flags),
            f"FCSL, {AT_RUN_TIME['kalman']}{label}": _fcsl(free, "kalman", flags),
            f"CasADi{label}": _c(folder, "kalman_casadi", flags),
            f"Eigen{label}": _eigen(folder, "kalman_eigen", flags),
            f"Eigen, symmetry used{label}": _eigen(folder, "kalman_eigen_symmetric", flags),
        }
    times, results = _time(program, inputs, 3, rounds, kernels)
    results["NumPy"], times["NumPy"] = _python(lambda: kalman_numpy(model, inputs), STEPS)
    results["Numba"], times["Numba"] = _python(lambda: kalman_numba(model, inputs), STEPS, warm=True)
    _compare(results, n + n * n)
    outputs = ("filter.outputs.x", "filter.state.p")
    times["CPython (PyTwin)"] = _twins(program, "kalman", (frozen, free), kernels, {"filter.inputs.z": inputs}, outputs)
    return times


def _attitude(folder: Path, program: Path, rounds: int) -> Figures:
    inputs = attitude_inputs()
    linear_casadi.attitude(folder)
    source, parameters = (HERE / "algorithms" / "attitude.py").read_text(), {"inertia": INERTIA, **GAINS}
    frozen = _machine(_folder(folder, "frozen"), "control", "Attitude", source, parameters, True)
    free = _machine(_folder(folder, "free"), "control", "Attitude", source, parameters, False)
    kernels: dict[str, Path] = {}
    for label, flags in BUILDS:
        kernels |= {
            f"FCSL{label}": _fcsl(frozen, "attitude", flags),
            f"FCSL, {AT_RUN_TIME['attitude']}{label}": _fcsl(free, "attitude", flags),
            f"CasADi{label}": _c(folder, "attitude_casadi", flags),
            f"Eigen{label}": _eigen(folder, "attitude_eigen", flags),
        }
    times, results = _time(program, inputs, 14, rounds, kernels)
    results["NumPy"], times["NumPy"] = _python(lambda: attitude_numpy(inputs), STEPS)
    results["Numba"], times["Numba"] = _python(lambda: attitude_numba(inputs), STEPS, warm=True)
    _compare(results, 6)
    ports = {"q": inputs[:, :4], "rate": inputs[:, 4:7], "q_wanted": inputs[:, 7:11], "rate_wanted": inputs[:, 11:]}
    columns = {f"control.inputs.{name}": values for name, values in ports.items()}
    outputs = ("control.outputs.torque", "control.state.trim")
    times["CPython (PyTwin)"] = _twins(program, "attitude", (frozen, free), kernels, columns, outputs)
    return times


# ---- kernels -------------------------------------------------------------------------------------------------------


def _folder(parent: Path, name: str) -> Path:
    made = parent / name
    made.mkdir(parents=True)
    return made


def _machine(
    folder: Path, instance: str, algorithm: str, source: str, parameters: dict[str, Any], frozen: bool
) -> Path:
    """A machine `bench` of one instance of the class `algorithm`, and its C, in `folder`."""
    (folder / "algorithm.py").write_text(source)
    config = {
        "tick_hz": 100,
        "initial_state": "RUN",
        "algorithms": {algorithm: {"source": "algorithm.py"}},
        "instances": {instance: {"algorithm": algorithm, "parameters": parameters, "frozen": frozen}},
        "states": {"RUN": {"schedule": {instance: 100}}},
        "transitions": [],
    }
    (folder / "bench.json").write_text(json.dumps(config))
    emit([folder / "bench.json"], folder)
    return folder


def _fcsl(folder: Path, kind: str, flags: list[str]) -> Path:
    sources = [str(HERE / f"{kind}_fcsl.c"), str(folder / "bench.c")]
    return _library([*compiler(), *flags, *(f"-I{d}" for d in include_dirs())], sources, folder, f"fcsl{len(flags)}")


def _c(folder: Path, kernel: str, flags: list[str]) -> Path:
    return _library([*compiler(), *flags], [str(PEERS / f"{kernel}.c")], folder, f"{kernel}{len(flags)}")


def _eigen(folder: Path, kernel: str, flags: list[str]) -> Path:
    own = [*CXX, *(f for f in flags if f not in FLAGS)]
    command = ["c++", *own, "-DNDEBUG", "-isystem", "/usr/include/eigen3"]
    return _library(command, [str(PEERS / f"{kernel}.cpp")], folder, f"{kernel}{len(flags)}")


def _library(command: list[str], sources: list[str], folder: Path, name: str) -> Path:
    library = folder / f"lib{name}.so"
    include = [f"-I{PEERS}", f"-I{folder}"]
    _run([*command, "-shared", *include, *sources, "-lm", "-o", str(library)])
    return library


def _run(command: list[str]) -> str:
    return subprocess.run(command, stdout=subprocess.PIPE, text=True, check=True).stdout


# ---- times ---------------------------------------------------------------------------------------------------------


def _time(
    program: Path, inputs: Matrix, per_step: int, rounds: int, kernels: dict[str, Path]
) -> tuple[Figures, dict[str, Matrix]]:
    """Medians of interleaved rounds, and what each computed. Kernels for this processor run by themselves: their wide
    instructions slow its clock, for a while, for whoever comes next."""
    samples = program.with_suffix(".inputs")
    samples.write_bytes(inputs.tobytes())
    times: Figures = {}
    results: dict[str, Matrix] = {}
    for group in filter(None, ([k for k in kernels if "native" not in k], [k for k in kernels if "native" in k])):
        command = [str(program), str(samples), str(per_step), str(rounds), *(str(kernels[name]) for name in group)]
        lines = json.loads(_run(command), parse_int=float)  # -0 is a float, too
        for name, line in zip(group, lines, strict=True):
            times[name], results[name] = line["ns"], np.array(line["result"])
    return times, results


def _python(run: Callable[[], Matrix], steps: int, *, warm: bool = False) -> tuple[Matrix, float]:
    """What it computes, and the best of three in processor time; `warm`: the first run compiles."""
    if warm:
        run()
    best = float("inf")
    for _ in range(3):
        begun = time.thread_time_ns()
        result = run()
        best = min(best, (time.thread_time_ns() - begun) / steps)
    return result, best


def _twins(
    program: Path,
    kind: str,
    machines: tuple[Path, Path],
    kernels: dict[str, Path],
    columns: dict[str, Matrix],
    outputs: tuple[str, ...],
) -> float:
    """ns per tick of the algorithm's own file in CPython, parameters frozen; with parameters frozen and not, its bits are those
    of the compiled kernels after as many steps."""
    inputs = np.ascontiguousarray(np.column_stack(list(columns.values()))[:TWIN_STEPS])
    spent = 0.0
    for machine, own in zip(machines, ("FCSL", f"FCSL, {AT_RUN_TIME[kind]}"), strict=True):
        compiled = {name: kernels[name] for name in (f"{own}{label}" for label, _ in BUILDS)}
        _, results = _time(program, inputs, inputs.shape[1], 1, compiled)
        expected, ns = _twin(machine / "bench.json", columns, outputs)
        for name, result in results.items():
            if result[: len(expected)].tobytes() != expected.tobytes():
                raise RuntimeError(f"{name} of {kind}: other bits than in CPython after {TWIN_STEPS} steps")
        spent = spent or ns
    return spent


def _twin(config: Path, columns: dict[str, Matrix], outputs: tuple[str, ...]) -> tuple[Matrix, float]:
    """The outputs after the last tick, one after the other, and ns per tick. The first one is left out: it makes the
    functions for the sizes at hand."""
    with PyTwin.from_config(config) as twin:
        spent = 0
        for step in range(TWIN_STEPS):
            for path, values in columns.items():
                twin.set(path, values[step].tolist())
            begun = time.thread_time_ns()
            twin.tick()
            spent += time.thread_time_ns() - begun if step else 0
        result = np.concatenate([np.ravel(np.array(twin.get_value(path), dtype=float)) for path in outputs])
    return result, spent / (TWIN_STEPS - 1)


def _compare(results: dict[str, Matrix], count: int) -> None:
    expected = results["NumPy"][:count]
    for name, result in results.items():
        apart = float(np.max(np.abs(result[:count] - expected)) / np.max(np.abs(expected)))
        if not apart <= MAX_APART:
            raise RuntimeError(f"{name} computes something else ({apart:.1e} apart)")


# ---- the table -----------------------------------------------------------------------------------------------------


def linear_rows(found: dict[str, Figures]) -> list[tuple[str, str]]:
    rows = []
    for table, times in found.items():
        rows.append((f"{table}", "ns per step"))
        rows += [(f"    {name}", f"{ns:.1f}") for name, ns in times.items()]
        rows += [(f"    {what}", f"{ratio:.2f} (goal {goal:.2f})") for what, ratio, goal in ratios(table, times)]
    return rows


def ratios(table: str, times: Figures) -> list[tuple[str, float, float]]:
    """What is compared with a goal."""
    kind = table.split()[0]
    at_run_time = ("at run time / Eigen", times[f"FCSL, {AT_RUN_TIME[kind]}"] / times["Eigen"])
    if kind == "attitude":
        return [(*at_run_time, 0.8)]
    return [("FCSL / CasADi", times["FCSL"] / times["CasADi"], _OF_CASADI[table]), (*at_run_time, 0.6)]


def _say(text: str) -> None:
    print(text, file=sys.stderr)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n\n", maxsplit=1)[0])
    parser.add_argument("--rounds", type=int, default=ROUNDS, help="interleaved rounds of %(default)s by default")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        for what, figure in linear_rows(linear_times(Path(folder), options.rounds)):
            print(f"{what:<44}{figure:>24}")
    return 0


if __name__ == "__main__":
    try:
        sys.exit(main())
    except (RuntimeError, subprocess.SubprocessError) as error:
        sys.exit(f"bench: {error}")
