# SPDX-License-Identifier: Apache-2.0
"""An array that a helper fills with zeros before a loop assigns its elements: the fill goes only where nobody sees it."""

from __future__ import annotations

from pathlib import Path

import pytest
from fcsl_test_abi import write_machine

from simclient import AlgTwin

HELPER = """
def ramp(x: f64) -> "f64[3]":
    values = [0.0, 0.0, 0.0]
{early}    for i in range(3):
        values[i] = x + f64(i)
    return values


class Law:
    inputs = {{"x": "f64"}}
    outputs = {{"first": "f64[3]", "then": "f64[3]"}}

    def execute(self):
        self.then = ramp(7.0)
        self.first = self.then
        self.then = ramp(self.x)
"""
EARLY = "    if x < 0.0:\n        return values\n"


@pytest.mark.parametrize(
    ("early", "x", "then"),
    [("", -1.0, [-1.0, 0.0, 1.0]), (EARLY, -1.0, [0.0, 0.0, 0.0]), (EARLY, 1.0, [1.0, 2.0, 3.0])],
)
def test_what_an_early_return_gives(early: str, x: float, then: list[float], tmp_path: Path) -> None:
    """Its storage is the caller's, which holds the values of the call before."""
    states = {"RUN": {"schedule": {"law": 100}}}
    machine = {"tick_hz": 100, "initial_state": "RUN", "instances": {"law": {"algorithm": "Law"}}, "states": states}
    config = write_machine(tmp_path, "fills", machine, {"law": HELPER.format(early=early)})
    with AlgTwin.from_config(config) as twin:
        twin.set("law.inputs.x", x)
        twin.tick()
        assert twin.get_value("law.outputs.first") == [7.0, 8.0, 9.0]
        assert twin.get_value("law.outputs.then") == then
