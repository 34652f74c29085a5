# SPDX-License-Identifier: Apache-2.0
"""The lander on a test stand (compiled, and in CPython) and in flight (the simulator)."""

import json
import shutil
from pathlib import Path

import pytest

from fcsl_sim import Simulation, load
from simclient import AlgTwin, PyTwin

EXAMPLE = Path(__file__).resolve().parents[1]


@pytest.fixture(params=[AlgTwin, PyTwin])
def twin(request):
    with request.param.from_config(EXAMPLE / "fc" / "lander_control.json") as twin:
        yield twin


@pytest.fixture(scope="session")
def fly():
    """fly(seed, sim="lander.sim.json", sets=[]): an opened simulation, at tick 0."""

    def open_simulation(seed, sim=EXAMPLE / "sim" / "lander.sim.json", sets=()):
        config = load(sim, seed=seed, sets=sets)
        assert config.warnings == ()
        return Simulation(config.plan, config.tables)

    return open_simulation


@pytest.fixture(scope="session")
def dropout_at(tmp_path_factory):
    """dropout_at(seconds, sensors): a simulation file in which the samples of these sensors stop at that time."""
    root = tmp_path_factory.mktemp("lander")
    for folder in ("fc", "sim"):
        shutil.copytree(EXAMPLE / folder, root / folder)
    config = json.loads((root / "sim" / "dropout.sim.json").read_text())

    def write(at_s, sensors):
        config["events"] = [{"at_s": at_s, "set": f"{s}.parameters.dropout", "value": True} for s in sensors]
        path = root / "sim" / f"dropout_{at_s}_{'_'.join(sensors)}.sim.json"
        path.write_text(json.dumps(config))
        return path

    return write


def to_the_end(sim):
    """Runs the simulation to its end. Returns the states entered, with the plant's truth in the first tick of each."""
    entered = []
    while sim.status == "running":
        state = sim.state
        sim.run(100_000)
        if sim.state != state:
            entered.append((sim.state, sim.get("lander.outputs.pos_z"), sim.get("lander.outputs.vel_z")))
    return entered
