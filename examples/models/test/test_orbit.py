# SPDX-License-Identifier: Apache-2.0
"""The two bodies in Rust: Newton's law, and what it conserves."""

import math

import pytest

G = 6.67430e-11  # m^3/(kg s^2)
EARTH, MOON = 5.972e24, 7.346e22  # kg
DISTANCE = 3.844e8  # m

PARAMETERS = {"mass": [EARTH, MOON], "position": [0.0, 0.0, DISTANCE, 0.0], "velocity": [0.0, -12.0, 0.0, 1000.0]}


def test_fields(model):
    orbit = model("orbit", **PARAMETERS)
    shapes = {path: (field.shape, field.unit) for path, field in orbit.fields.items()}
    assert shapes == {
        "parameters.mass": ((2,), "kg"),
        "parameters.position": ((2, 2), "m"),
        "parameters.velocity": ((2, 2), "m/s"),
        "state.position": ((2, 2), "m"),
        "state.velocity": ((2, 2), "m/s"),
        "outputs.position": ((2, 2), "m"),
        "outputs.distance": ((), "m"),
        "outputs.energy": ((), "J"),
    }
    assert orbit.fields["outputs.energy"].doc == "kinetic and potential; constant"
    assert orbit.doc == "two bodies that attract each other, in a plane"
    assert orbit.is_second_order and orbit.continuous_count == 8
    assert not orbit.has("update") and not orbit.has("event")


def test_newtons_law(model):
    orbit = model("orbit", **PARAMETERS)
    x = orbit.continuous
    assert x == [*PARAMETERS["position"], *PARAMETERS["velocity"]]
    angle = 0.7  # any direction
    x[2:4] = [DISTANCE * math.cos(angle), DISTANCE * math.sin(angle)]
    rates = orbit.derivative(0.0, x)
    assert rates[:4] == x[4:]
    first, second = G * MOON / DISTANCE**2, G * EARTH / DISTANCE**2
    towards = [math.cos(angle), math.sin(angle)]
    expected = [first * towards[0], first * towards[1], -second * towards[0], -second * towards[1]]
    assert rates[4:] == pytest.approx(expected, rel=1e-13)


def test_the_accelerations_do_not_depend_on_velocities(model):
    """What is_second_order promises."""
    orbit = model("orbit", **PARAMETERS)
    x = orbit.continuous
    slow, fast = orbit.derivative(0.0, x), orbit.derivative(0.0, [*x[:4], 1.0, 2.0, 3.0, 4.0])
    assert slow[4:] == fast[4:] and fast[:4] == [1.0, 2.0, 3.0, 4.0]


def test_outputs(model):
    orbit = model("orbit", **PARAMETERS)
    orbit.output()
    energy = 0.5 * EARTH * 12.0**2 + 0.5 * MOON * 1000.0**2 - G * EARTH * MOON / DISTANCE
    assert orbit.get("outputs.distance") == DISTANCE
    assert orbit.get("outputs.energy") == pytest.approx(energy, rel=1e-14)
    assert orbit.get("outputs.position") == PARAMETERS["position"]


def test_two_bodies_at_one_place_are_refused(model):
    with pytest.raises(ValueError, match="^parameters.position must be of two places$"):
        model("orbit", **{**PARAMETERS, "position": [1.0, 2.0, 1.0, 2.0]})
