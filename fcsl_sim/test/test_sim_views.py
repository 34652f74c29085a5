# SPDX-License-Identifier: Apache-2.0
"""`views` of a simulation: paths of machine and models, the machine's views replaced, in bags and telemetry."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from fcsl_compiler.base.diagnostics import DiagnosticError
from fcsl_sim import SimConfig, Simulation, load
from simclient.bag import Bag
from simclient.telemetry.receiver import Telemetry

LANDER = Path(__file__).resolve().parents[2] / "examples/lander/sim/lander.sim.json"
HEIGHT = {
    "title": "height",
    "truth": ["ramp.outputs.x"],
    "measured": ["altimeter.outputs.value"],
    "estimate": ["pilot.outputs.pos_z"],
}
BODY = {"shape": "multirotor", "position": [0, 0, "ramp.state.x"], "thrust": "pilot.outputs.throttle"}
TEXT = (
    '{"body":{"position":[0,0,"ramp.state.x"],"shape":"multirotor","size":1.0,"thrust":"pilot.outputs.throttle",'
    '"up":"+z"},"panels":[{"angles":false,"estimate":["pilot.outputs.pos_z"],"measured":["altimeter.outputs.value"],'
    '"title":"height","truth":["ramp.outputs.x"]}]}'
)


def views(*panels: Any, **more: Any) -> Callable[[dict[str, Any]], object]:
    return lambda config: config.update(views={"panels": list(panels), **more})


def panel(*paths: str) -> dict[str, Any]:
    return {"title": "t", "values": list(paths)}


def recorded(sim: Simulation, bag: Path) -> str:
    with sim:
        sim.record(bag)
        sim.run(3)
        sim.record_stop()
    opened = Bag(bag)
    return opened.views(opened.machine())


def test_a_bag_has_those_of_the_simulation(open_sim: Callable[..., Simulation], tmp_path: Path) -> None:
    assert recorded(open_sim(views(HEIGHT, body=BODY)), tmp_path / "own") == TEXT
    assert recorded(open_sim(), tmp_path / "none") == ""


def test_telemetry_has_them(open_sim: Callable[..., Simulation]) -> None:
    telemetry = Telemetry(0)
    try:
        with open_sim(views(HEIGHT, body=BODY)) as sim:
            sim.telemetry(f"udp:localhost:{telemetry.port}", None)
            sim.run(3)
            sim.telemetry_stop()
        telemetry.poll()
        assert telemetry.machine.views == TEXT
    finally:
        telemetry.close()


def test_they_replace_the_machines(tmp_path: Path) -> None:
    """Those of the lander's machine know no truth; without a block of its own, a simulation has them."""
    config = load(LANDER)
    own = json.loads(recorded(Simulation(config.plan, config.tables), tmp_path / "own"))
    assert (
        own["panels"][0]["truth"] == ["lander.outputs.pos_z"] and own["body"]["position"][2] == "lander.outputs.pos_z"
    )
    simulation = json.loads(LANDER.read_text())
    for kept, members in enumerate(({}, {"views": {}})):
        text = json.dumps({**{k: v for k, v in simulation.items() if k != "views"}, **members})
        text = text.replace("../fc/", f"{LANDER.parents[1]}/fc/")
        (tmp_path / "lander.sim.json").write_text(text)
        (tmp_path / "lander_plant.c").write_text((LANDER.parent / "lander_plant.c").read_text())
        config = load(tmp_path / "lander.sim.json")
        found = recorded(Simulation(config.plan, config.tables), tmp_path / f"kept{kept}")
        assert found == config.machine.views != "" and "lander.outputs" not in found


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (views(panel("romp.outputs.x")), "E206: no instance `romp`"),
        (views(panel("ramp.x")), "E215: a view shows a field of inputs, parameters, outputs, state, not `ramp.x`"),
        (views(panel("ramp.outputs.y")), "E216: `ramp` has no field `outputs.y`"),
        (views(panel("pilot.outputs.pos_x")), "E216: `pilot` has no field `outputs.pos_x`"),
        (views(panel("pilot.outputs.health")), "E245: `pilot.outputs.health` is Health, and a view shows numbers and bools"),
        (views(panel("ramp.outputs.x", "pilot.outputs.vel_z")), "E247: `pilot.outputs.vel_z` is in m/s, and the panel in m"),
        (views(panel()), "E246: a panel without curves"),
        (views(HEIGHT, body={"shape": "mesh", "mesh": "no.stl", "position": [0, 0, 1]}), "E100: cannot read `no.stl`: no such file"),
    ],
)  # fmt: skip
def test_messages(change: Any, expected: str, load_sim: Callable[..., SimConfig]) -> None:
    with pytest.raises(DiagnosticError) as caught:
        load_sim(change)
    assert [f"{d.code}: {d.message}" for d in caught.value.diagnostics] == [expected]
    assert caught.value.diagnostics[0].span.source.name.endswith("ramp.sim.json")


def test_a_model_with_an_error_hides_no_other(load_sim: Callable[..., SimConfig]) -> None:
    def change(config: dict[str, Any]) -> None:
        views(panel("ramp.outputs.y", "altimeter.outputs.y"))(config)
        config["models"]["ramp"]["source"] = "none.c"

    with pytest.raises(DiagnosticError) as caught:
        load_sim(change)
    assert [d.code for d in caught.value.diagnostics] == ["E801", "E216"]
