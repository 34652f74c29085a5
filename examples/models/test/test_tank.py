# SPDX-License-Identifier: Apache-2.0
"""The tank in Nim: its equation, its event, what is checked."""

import math

import pytest

PARAMETERS = {"area": 0.5, "hole": 1e-3, "gravity": 9.81, "rim": 2.0, "level": 1.25}


def test_fields_and_events(model):
    tank = model("tank", **PARAMETERS)
    units = {path: (field.role, field.type, field.unit) for path, field in tank.fields.items()}
    assert units == {
        "inputs.flow": ("input", "f64", "m^3/s"),
        "parameters.area": ("parameter", "f64", "m^2"),
        "parameters.hole": ("parameter", "f64", "m^2"),
        "parameters.gravity": ("parameter", "f64", "m/s^2"),
        "parameters.rim": ("parameter", "f64", "m"),
        "parameters.level": ("parameter", "f64", "m"),
        "state.level": ("state", "f64", "m"),
        "state.overflows": ("state", "u32", ""),
        "outputs.level": ("output", "f64", "m"),
        "outputs.drain": ("output", "f64", "m^3/s"),
        "outputs.overflows": ("output", "u32", ""),
    }
    assert tank.doc == "a tank with a hole"
    assert [(event.name, event.crossing) for event in tank.events] == [("overflow", "falling")]
    assert not tank.is_second_order and not tank.has("update")


def test_the_level_changes_by_what_flows_in_and_out(model):
    tank = model("tank", **PARAMETERS)
    assert tank.continuous == [1.25]
    tank.set("inputs.flow", 4e-3)
    drain = 1e-3 * math.sqrt(2 * 9.81 * 0.8)
    assert tank.derivative(0.0, [0.8]) == pytest.approx([(4e-3 - drain) / 0.5], rel=1e-15)
    tank.output(0.0, [0.8])
    assert tank.get("outputs.drain") == pytest.approx(drain, rel=1e-15)
    assert tank.derivative(0.0, [-0.1]) == [4e-3 / 0.5]


def test_it_spills_at_the_rim(model):
    tank = model("tank", **PARAMETERS)
    assert tank.event(0.0, [1.5]) == [0.5] and tank.event(0.0, [2.5]) == [-0.5]
    tank.reset(0)
    assert tank.continuous == [0.9 * 2.0] and tank.get("state.overflows") == 1


def test_the_area_is_checked(model):
    with pytest.raises(ValueError, match="^parameters.area must be positive$"):
        model("tank", **{**PARAMETERS, "area": math.nan})
