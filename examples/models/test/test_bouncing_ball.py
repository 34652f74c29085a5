# SPDX-License-Identifier: Apache-2.0
"""The ball in C: free fall between bounces, and what a bounce does."""

import pytest

PARAMETERS = {"gravity": 9.81, "restitution": 0.8, "rest_speed": 0.1, "height": 10.0, "speed": 1.5}


def test_fields_and_events(model):
    ball = model("bouncing_ball", **PARAMETERS)
    units = {path: (field.type, field.unit) for path, field in ball.fields.items()}
    assert units == {
        "parameters.gravity": ("f64", "m/s^2"),
        "parameters.restitution": ("f64", ""),
        "parameters.rest_speed": ("f64", "m/s"),
        "parameters.height": ("f64", "m"),
        "parameters.speed": ("f64", "m/s"),
        "state.height": ("f64", "m"),
        "state.speed": ("f64", "m/s"),
        "state.resting": ("bool", ""),
        "state.bounces": ("u32", ""),
        "outputs.height": ("f64", "m"),
        "outputs.speed": ("f64", "m/s"),
        "outputs.resting": ("bool", ""),
        "outputs.bounces": ("u32", ""),
    }
    assert not any(field.is_feedthrough for field in ball.fields.values())
    assert [(event.name, event.crossing) for event in ball.events] == [("bounce", "falling")]
    assert not ball.is_second_order


def test_it_falls_freely(model):
    ball = model("bouncing_ball", **PARAMETERS)
    assert ball.continuous == [10.0, 1.5]
    assert ball.derivative(0.0, [3.0, -2.0]) == [-2.0, -9.81]
    ball.output(0.5, [3.0, -2.0])
    assert [ball.get(f"outputs.{name}") for name in ("height", "speed", "resting", "bounces")] == [3.0, -2.0, False, 0]


def test_a_bounce_reverses_the_speed(model):
    ball = model("bouncing_ball", **PARAMETERS)
    assert ball.event(0.0, [0.25, -5.0]) == [0.25] and ball.event(0.0, [-0.25, -5.0]) == [-0.25]
    ball.continuous = [-1e-9, -5.0]
    ball.reset(0)
    assert ball.continuous == [0.0, 4.0] and ball.get("state.bounces") == 1 and not ball.get("state.resting")


def test_a_slow_one_stays_on_the_ground(model):
    ball = model("bouncing_ball", **PARAMETERS)
    ball.continuous = [-1e-9, -0.0625]
    ball.reset(0)
    ball.output()
    assert ball.continuous == [0.0, 0.0] and ball.get("outputs.resting")
    assert ball.derivative(1.0, ball.continuous) == [0.0, 0.0]
    assert ball.event()[0] > 0.0  # it does not bounce again


@pytest.mark.parametrize(
    ("parameter", "value"),
    [("gravity", 0.0), ("restitution", 1.5), ("restitution", float("nan")), ("rest_speed", 0.0), ("height", -1.0)],
)
def test_parameters_are_checked(model, parameter, value):
    with pytest.raises(ValueError, match=f"^parameters.{parameter} must be "):
        model("bouncing_ball", **{**PARAMETERS, parameter: value})
