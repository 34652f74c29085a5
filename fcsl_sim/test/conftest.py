# SPDX-License-Identifier: Apache-2.0
"""A controller and simulations to test with: `hopper` is test/machines/hopper.json."""

from __future__ import annotations

import copy
import json
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.api.build import build_machine
from fcsl_sim import SimConfig, Simulation, load

TEST = Path(__file__).resolve().parent

#: The hopper on a ramp: x' = throttle, measured without noise.
RAMP: dict[str, Any] = {
    "controller": {"machine": "hopper.json"},
    "seed": 1,
    "duration": 1.0,
    "integrator": {"method": "rk4", "hz": 1000},
    "models": {
        "ramp": {"source": "ramp.c"},
        "sensor": {"source": "package://fcsl_sim/models/noisy_sensor.c"},
    },
    "instances": {
        "ramp": {"model": "ramp"},
        "altimeter": {"model": "sensor", "parameters": {"bias": 0.0, "sigma": 0.0, "dropout": False}},
        "velocimeter": {"model": "sensor", "parameters": {"bias": 0.0, "sigma": 0.0, "dropout": False}},
    },
    "connections": [
        {"from": "ramp.x", "to": "altimeter.truth"},
        {"from": "ramp.seen_rate", "to": "velocimeter.truth"},
        {"from": "altimeter.value", "to": "controller.altitude"},
        {"from": "velocimeter.value", "to": "controller.velocity"},
        {"from": "controller.throttle", "to": "ramp.rate"},
    ],
    "rates": {"altimeter": 100, "velocimeter": 100},
}

Change = Callable[[dict[str, Any]], object]


def open_models(open_sim: Callable[..., Simulation], instances: dict[str, Any], **keys: Any) -> Simulation:
    """Opens RAMP with further instances, of models in test/models; `keys` replace members of the file."""

    def change(config: dict[str, Any]) -> None:
        config.update(keys)
        for name, instance in instances.items():
            config["instances"][name] = instance
            config["models"].setdefault(instance["model"], {"source": f"{instance['model']}.c"})

    return open_sim(change)


@pytest.fixture
def lander() -> Path:
    """The simulation of the lander example."""
    return TEST.parents[1] / "examples/lander/sim/lander.sim.json"


@pytest.fixture(scope="session")
def hopper() -> tuple[Path, str]:
    """Library and machine name of the controller."""
    return build_machine(TEST / "machines/hopper.json").library, "hopper"


@pytest.fixture
def write_sim(tmp_path: Path) -> Callable[..., Path]:
    """Writes RAMP, changed by a function, and its models, `chain` with a macro; returns the path of the *.sim.json."""

    def write(change: Change = lambda config: None, define: str = "") -> Path:
        config = copy.deepcopy(RAMP)
        change(config)
        for model in (TEST / "models").glob("*.c"):
            shutil.copy(model, tmp_path)
        if define:
            chain = tmp_path / "chain.c"
            chain.write_text(f"#define {define}\n{chain.read_text()}")
        path = tmp_path / "ramp.sim.json"
        path.write_text(json.dumps(config, indent=2))
        return path

    return write


@pytest.fixture
def load_sim(write_sim: Callable[..., Path], hopper: tuple[Path, str]) -> Callable[..., SimConfig]:
    """Loads RAMP, changed by a function, with the hopper as controller."""

    def load_changed(change: Change = lambda config: None, define: str = "", **options: Any) -> SimConfig:
        return load(write_sim(change, define), machine=hopper, **options)

    return load_changed


@pytest.fixture
def open_sim(load_sim: Callable[..., SimConfig]) -> Callable[..., Simulation]:
    """Opens RAMP, changed by a function."""

    def open_changed(change: Change = lambda config: None, **options: Any) -> Simulation:
        config = load_sim(change, **options)
        return Simulation(config.plan, config.tables)

    return open_changed
