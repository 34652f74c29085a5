# SPDX-License-Identifier: Apache-2.0
"""Controllers of a simulation begin with the parameters of a file."""

from __future__ import annotations

import json
import shutil
import subprocess
from contextlib import closing
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from test_controllers import Load, load_two  # noqa: F401  (a fixture)
from test_machine_model import load_lag  # noqa: F401

from fcsl_sim.config import SimConfig
from fcsl_sim.native import Simulation
from fcsl_sim.sim_run import SimRun
from simclient import SimTwin, TwinError
from simclient.bag.digest import digest
from simclient.parameters import Parameters, read_parameters

FILE = "/**:\n  ros__parameters:\n    hold.gain: 3.0  # [1/s]\nslow:\n  ros__parameters: {hold.target: 0.5}\n"


def given(config: SimConfig, parameters: Parameters | None) -> SimConfig:
    return replace(config, plan=replace(config.plan, parameters=parameters))


def values(config: SimConfig) -> list[Any]:
    """Gain and target of both controllers."""
    with closing(SimRun(config)) as run:
        twin = SimTwin(run)
        return [twin.get(f"{prefix}hold.parameters.{name}") for prefix in ("", "two.") for name in ("gain", "target")]


def test_each_controller_has_its_sections(load_two: Load, tmp_path: Path) -> None:  # noqa: F811
    (tmp_path / "params.yaml").write_text(FILE)
    assert values(load_two()) == [2.0, 1.0, 2.0, 1.0]
    assert values(given(load_two(), read_parameters(tmp_path / "params.yaml"))) == [3.0, 1.0, 3.0, 0.5]


def test_a_section_for_one_of_them_is_enough(load_two: Load) -> None:  # noqa: F811
    slow = Parameters(b"slow: {ros__parameters: {hold.gain: 4.0}}", "p.yaml")
    assert values(given(load_two(), slow)) == [2.0, 1.0, 4.0, 1.0]
    others = Parameters(b"others: {ros__parameters: {hold.gain: 4.0}}", "p.yaml")
    with pytest.raises(TwinError, match=r"p\.yaml: no section is for a controller"):
        values(given(load_two(), others))


def test_the_flight_is_that_of_the_edited_machine(tmp_path: Path, lander: Path) -> None:
    """In the bag, too; `fcsl sim run` and SimTwin are the same."""
    copied = tmp_path / "copied"
    shutil.copytree(lander.parents[1], copied, ignore=shutil.ignore_patterns("test", "__pycache__"))
    machine = (copied / "sim" / json.loads(lander.read_text())["controller"]["machine"]).resolve()
    config = json.loads(machine.read_text())
    config["instances"]["ascent"]["parameters"]["climb_rate"] = 8.125
    machine.write_text(json.dumps(config))
    (tmp_path / "params.yaml").write_text("/**:\n  ros__parameters:\n    ascent.climb_rate: 8.125\n")
    line = ["fcsl-sim", "run", "--duration", "20", "--record"]
    for more in (
        [tmp_path / "bound", lander, "--parameters", tmp_path / "params.yaml"],
        [tmp_path / "edited", copied / "sim" / lander.name],
        [tmp_path / "plain", lander],
    ):
        assert subprocess.run([*line, *map(str, more)], capture_output=True).returncode == 1  # it has not landed yet
    assert digest(tmp_path / "bound") == digest(tmp_path / "edited") != digest(tmp_path / "plain")
    with SimTwin.from_config(lander, parameters={"ascent.climb_rate": 8.125}) as twin:
        assert twin.get("ascent.parameters.climb_rate") == 8.125
    with pytest.raises(TwinError, match="did you mean `ascent.climb_rate`"):
        SimTwin.from_config(lander, parameters={"ascent.climb_rat": 1.0})


def test_commands_refuse(lander: Path, tmp_path: Path) -> None:
    for more, said in (
        (["--parameters", tmp_path / "none.yaml"], "none.yaml: No such file"),
        (["--parameters", lander, "--external", "wire:unix:x"], "give them to the external one"),
        (["--parameters", lander, "--restore", "x"], "does not go with `--restore`"),
    ):
        done = subprocess.run(["fcsl-sim", "run", str(lander), *map(str, more)], capture_output=True, text=True)
        assert done.returncode == 2 and said in done.stderr, done.stderr


def test_start_of_a_machine_as_a_model_reads_its_parameters(load_lag: Load) -> None:  # noqa: F811
    def change(config: dict[str, Any]) -> None:
        config["instances"]["filter"]["parameters"] = {"bias": [3.0, 0.0]}

    config = load_lag(change)
    with Simulation(config.plan, config.tables) as sim:
        assert sim.get("filter.outputs.y") == 3.0
