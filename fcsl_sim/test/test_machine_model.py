# SPDX-License-Identifier: Apache-2.0
"""An algorithm in Python as a model of a simulation."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, Simulation

Load = Callable[..., SimConfig]

#: A first-order lag, and a struct member would be `outputs.a.b`.
LAG = """
class Lag:
    inputs = {"u": "f64"}
    outputs = {"y": "f64", "history": "f64[2]"}
    parameters = {"share": "f64", "bias": "f64[2]"}
    state = {"updates": "i64"}

    def start(self):
        self.y = self.bias[0]

    def execute(self):
        self.updates = self.updates + 1
        self.history[1] = self.history[0]
        self.history[0] = self.y
        self.y = self.y + self.share * (self.u - self.y)
"""
MACHINE: dict[str, Any] = {
    "tick_hz": 50,
    "initial_state": "RUN",
    "algorithms": {"Lag": {"source": "lag.py"}},
    "instances": {"lag": {"algorithm": "Lag", "parameters": {"share": 0.5, "bias": [8.0, 0.0]}}},
    "states": {"RUN": {"schedule": {"lag": 50}}},
}


@pytest.fixture
def load_lag(load_sim: Load, tmp_path: Path) -> Load:
    """The ramp, whose position goes through the lag to the altimeter."""

    def load_with(change: Callable[[dict[str, Any]], object] = lambda config: None, **machine: Any) -> SimConfig:
        (tmp_path / "lag.py").write_text(LAG)
        (tmp_path / "lag.json").write_text(json.dumps(MACHINE | machine))

        def with_lag(config: dict[str, Any]) -> None:
            config["models"]["lag"] = {"machine": "lag.json"}
            config["instances"]["filter"] = {"model": "lag"}
            config["rates"]["filter"] = 50
            config["connections"][0] = {"from": "ramp.x", "to": "filter.u"}
            config["connections"].append({"from": "filter.y", "to": "altimeter.truth"})
            change(config)

        return load_sim(with_lag)

    return load_with


def test_it_is_updated_at_its_rate_and_feeds_others(load_lag: Load) -> None:
    config = load_lag()
    with Simulation(config.plan, config.tables) as sim:
        y, before = 8.0, [0.0, 0.0]
        for tick in range(100):
            sim.run(1)
            if tick % 2 == 0:
                before = [y, before[0]]
                y += 0.5 * (tick / 100 - y)
            assert sim.get("filter.outputs.y") == pytest.approx(y, abs=1e-12)
            assert sim.get("altimeter.outputs.value") == sim.get("filter.outputs.y")
            assert sim.get("filter.outputs.history") == pytest.approx(before, abs=1e-12)
        assert sim.get("filter.state.updates") == 50


def test_its_parameters_have_values_that_a_simulation_replaces(load_lag: Load) -> None:
    def change(config: dict[str, Any]) -> None:
        config["instances"]["filter"]["parameters"] = {"share": 1.0}
        config["events"] = [{"at_s": 0.5, "set": "filter.parameters.share", "value": 0.0}]

    config = load_lag(change)
    with Simulation(config.plan, config.tables) as sim:
        sim.run(50)
        assert sim.get("filter.outputs.y") == pytest.approx(0.48)
        sim.run(50)
        assert sim.get("filter.outputs.y") == pytest.approx(0.48)


def test_it_continues_from_a_checkpoint(load_lag: Load) -> None:
    config = load_lag()
    with Simulation(config.plan, config.tables) as one, Simulation(config.plan, config.tables) as other:
        one.run(33)
        other.restore_checkpoint(one.checkpoint())
        for _ in range(60):
            one.run(1)
            other.run(1)
            assert one.get("filter.outputs.y") == other.get("filter.outputs.y")


@pytest.mark.parametrize(
    ("change", "machine", "message"),
    [
        (
            lambda c: c["rates"].update(filter=100),
            {},
            "E804: `filter` is a machine with a tick_hz of 50: its rate is that",
        ),
        (lambda c: c["rates"].pop("filter"), {}, "E804: `filter` has no rate"),
        (
            lambda c: c["models"].update(lag={"machine": "no.json"}),
            {},
            "E801: the machine `no.json` cannot be used as a model: ",
        ),
        (lambda c: c["models"]["lag"].update(source="lag.c"), {}, "E801: model `lag` has `machine` and `source`"),
        (
            lambda c: None,
            {
                "instances": {
                    name: {"algorithm": "Lag", "parameters": {"share": 0.5, "bias": [0.0, 0.0]}} for name in ("a", "b")
                },
                "states": {"RUN": {"schedule": {"a": 50, "b": 50}}},
            },
            "E801: the machine `lag.json` cannot be used as a model: it has 2 instances (a, b), and a model is one",
        ),
    ],
)
def test_what_is_refused(
    change: Callable[[dict[str, Any]], object], machine: dict[str, Any], message: str, load_lag: Load
) -> None:
    with pytest.raises(DiagnosticError) as error:
        load_lag(change, **machine)
    assert f"{error.value.diagnostics[0].code}: {error.value.diagnostics[0].message}".startswith(message)
