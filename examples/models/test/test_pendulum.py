# SPDX-License-Identifier: Apache-2.0
"""The pendulum in C++: its equation of motion, and the output that depends on its input at once."""

import math

import pytest

PARAMETERS = {"mass": 2.0, "length": 0.5, "inertia": 0.7, "damping": 0.1, "gravity": 9.81, "angle": 0.3, "rate": -0.2}


def test_fields(model):
    pendulum = model("pendulum", **PARAMETERS)
    outputs = {path: field for path, field in pendulum.fields.items() if field.role == "output"}
    assert {path: (field.unit, field.is_feedthrough) for path, field in outputs.items()} == {
        "outputs.angle": ("rad", False),
        "outputs.rate": ("rad/s", False),
        "outputs.acceleration": ("rad/s^2", True),
    }
    assert [path for path, field in pendulum.fields.items() if field.role == "input"] == ["inputs.torque"]
    assert pendulum.doc == "a pendulum with damping and a motor" and pendulum.events == []
    assert not pendulum.has("update") and not pendulum.has("event") and not pendulum.has("reset")


@pytest.mark.parametrize("angle", [0.0, 0.3, -1.2, math.pi / 2, 3.0])
def test_the_equation_of_motion(model, angle):
    pendulum = model("pendulum", **PARAMETERS)
    assert pendulum.continuous == [0.3, -0.2]
    pendulum.set("inputs.torque", 1.5)
    rate = 0.4
    acceleration = (1.5 - 0.1 * rate - 2.0 * 9.81 * 0.5 * math.sin(angle)) / 0.7
    assert pendulum.derivative(0.0, [angle, rate]) == pytest.approx([rate, acceleration], rel=1e-14)
    pendulum.output(0.0, [angle, rate])
    assert pendulum.get("outputs.acceleration") == pendulum.derivative(0.0, [angle, rate])[1]


def test_the_inertia_is_checked(model):
    with pytest.raises(ValueError, match="^parameters.inertia must be positive$"):
        model("pendulum", **{**PARAMETERS, "inertia": 0.0})
