# SPDX-License-Identifier: Apache-2.0
"""Shared by the tests of the numeric library: one tick, and bounds of rounding errors."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from fcsl_test_abi import TYPES, Machine
from fcsl_test_twins import Twins
from numpy.typing import NDArray

Array = NDArray[np.float64]

#: Half a unit in the last place of 1: the largest relative error of one rounding.
ROUNDING = 2.0**-53


def gamma(n: int) -> float:
    """Bound of the relative error of n successive roundings (Higham, "Accuracy and Stability …", lemma 3.1)."""
    return n * ROUNDING / (1 - n * ROUNDING)


def run(machine: Machine, inputs: Mapping[str, Array | float]) -> dict[str, Any]:
    """Runs one tick. Returns outputs and state as arrays."""
    for name, value in inputs.items():
        machine.set(f"one.inputs.{name}", np.ravel(np.asarray(value)).tolist())
    machine.step()
    return results(machine)


def run_both(twins: Twins, inputs: Mapping[str, Array | float], where: str) -> dict[str, Any]:
    """Runs one tick in the compiled machine and in CPython (thousands of times slower) and compares bit for bit."""
    for name, value in inputs.items():
        twins.set(f"one.inputs.{name}", np.ravel(np.asarray(value)).tolist())
    twins.step(where=where)
    return results(twins.native)


def results(machine: Machine) -> dict[str, Any]:
    assert machine.get("one.outputs.health") == "nominal"
    found = {}
    for path, field in machine.fields.items():
        if path.startswith(("one.outputs.", "one.state.")) and TYPES[field.type] == "f64":
            shape = [field.shape[i] for i in range(field.rank)]
            found[path.rsplit(".", 1)[1]] = np.array(machine.get(path)).reshape(shape)
    return found


def within(found: Any, expected: Any, bound: Any, what: str) -> None:
    """Asserts that each element differs by at most its bound. NaN always fails."""
    difference = np.abs(np.asarray(found) - np.asarray(expected))
    assert np.all(difference <= bound), f"{what}: off by {np.max(difference)}, allowed {np.max(bound)}"
