# SPDX-License-Identifier: Apache-2.0
"""The selectors of the example vehicles: a law that faults in its first run has old outputs, and nobody obeys them."""

from pathlib import Path

import numpy as np
import pytest

from simclient import AlgTwin

EXAMPLES = Path(__file__).parents[1] / "examples"

#: Machine, state, law, its output with a value of an earlier flight, and the output of the one who obeys it.
SELECTORS = [
    ("lander/fc/lander_control", "ASCENT", "ascent", "throttle", 0.7, "engine.outputs.throttle"),
    ("lander/fc/lander_control", "DESCENT", "descent", "throttle", 0.7, "engine.outputs.throttle"),
    ("lander/fc/lander_control", "SAFE", "safe", "throttle", 0.7, "engine.outputs.throttle"),
    ("satellite/fc/satellite", "POINT", "point", "torque", [0.1, 0.2, 0.3], "wheel_drive.outputs.torque"),
    ("satellite/fc/satellite", "SAFE", "safe", "torque", [0.1, 0.2, 0.3], "wheel_drive.outputs.torque"),
    ("quadrotor/fc/quadrotor", "MISSION", "mission", "target", [50.0, 60.0, -70.0], "reference.outputs.target"),
    ("quadrotor/fc/quadrotor", "LAND", "land", "target", [50.0, 60.0, -70.0], "reference.outputs.target"),
    ("quadrotor/fc/quadrotor", "HOLD", "rate", "torque", [0.1, 0.1, 0.1], "mixer.outputs.thrusts"),
    ("rocket_landing/fc/rocket_landing", "DESCENT", "descent", "acceleration", [5.0, 5.0, -5.0], "steering.state.wanted"),
    ("rocket_landing/fc/rocket_landing", "DESCENT", "attitude", "angular_acceleration", [0.1, 0.1], "actuators.outputs.nozzle_x"),
    ("glider/fc/glider", "LOITER", "loiter", "command.course", 2.0, "reference.outputs.course_error"),
]  # fmt: skip


@pytest.mark.parametrize(("machine", "state", "law", "output", "old", "obeyed"), SELECTORS)
def test_nobody_obeys_a_law_that_has_not_run(
    machine: str, state: str, law: str, output: str, old: float | list[float], obeyed: str
) -> None:
    """With the old output and a fault as without one: what would be obeyed stays, or is what it is without the law."""
    found = []
    for value in (old, np.zeros_like(old).tolist()):
        with AlgTwin.from_config(EXAMPLES / f"{machine}.json") as twin:
            twin.tick(3)
            twin.set(f"{law}.outputs.{output}", value)
            twin.set_state(state)
            twin.fault(law)
            twin.tick()
            assert twin.get_value(f"{law}.outputs.health") == "failed"
            found.append(np.array(twin.get_value(obeyed)))
    assert np.array_equal(*found), found
