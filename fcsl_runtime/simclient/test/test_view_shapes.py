# SPDX-License-Identifier: Apache-2.0
"""The vehicles of the 3D view are as large as their views say, stand where they should, and are seen whole."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
import pytest
import rerun as rr

from simclient.view.blueprint import Plan
from simclient.view.body import _PARTS, TOPS
from simclient.view.scene import Cast, Scene
from simclient.view.signals import Signals
from simclient.view.views import Body, Views

SHAPES = sorted(_PARTS)


def numbers(batch: Any) -> np.ndarray:
    return np.array(batch.as_arrow_array().to_pylist(), dtype=np.float64)


def corners(part: Any) -> np.ndarray:
    """Of the boxes around what a part consists of, shape (N, 3)."""
    if isinstance(part, rr.LineStrips3D):
        return np.concatenate([np.array(strip, dtype=np.float64) for strip in part.strips.as_arrow_array().to_pylist()])
    if isinstance(part, rr.Boxes3D):
        halves = numbers(part.half_sizes)
    else:
        radii, lengths = numbers(part.radii), numbers(part.lengths)
        lies = part.rotation_axis_angles is not None  # turned about x, the axis of a wheel is y
        halves = np.stack([radii, *((lengths / 2, radii) if lies else (radii, lengths / 2))], axis=1)
    signs = np.array(list(product((-1, 1), repeat=3)))
    return np.concatenate([centre + signs * half for centre, half in zip(numbers(part.centers), halves, strict=True)])


@pytest.mark.parametrize("shape", SHAPES)
def test_a_shape_has_its_extent_and_two_equal_sides(shape: str) -> None:
    parts = {name: corners(part) for name, part in _PARTS[shape]().items()}
    everything = np.concatenate(list(parts.values()))
    assert 0.7 < np.ptp(everything, axis=0).max() <= 1.0
    assert np.ptp(everything, axis=0).min() > 0.1
    left = {tuple(np.round(corner, 6) + 0.0) for corner in everything}
    assert left == {tuple(np.round(corner * (1, -1, 1), 6) + 0.0) for corner in everything}
    top = max(corner[2] for name, part in parts.items() if name != "fin" for corner in part)
    assert top == pytest.approx(TOPS[shape], abs=0.01)


@pytest.mark.parametrize("shape", ["lander", "rover"])
def test_what_stands_on_the_ground_stands_on_its_origin(shape: str) -> None:
    parts = {name: corners(part) for name, part in _PARTS[shape]().items()}
    lowest = {name: float(part[:, 2].min()) for name, part in parts.items()}
    assert min(lowest.values()) == pytest.approx(0.0, abs=1e-6) and lowest["hull"] > 0.1


@pytest.mark.parametrize("shape", SHAPES)
def test_parts_touch_each_other(shape: str) -> None:
    """None floats beside the vehicle: the boxes around it and around the hull meet."""
    parts = {name: corners(part) for name, part in _PARTS[shape]().items()}
    for name, part in parts.items():
        others = [other for key, other in parts.items() if key != name]
        assert any(
            (part.min(axis=0) <= other.max(axis=0) + 0.01).all()
            and (part.max(axis=0) >= other.min(axis=0) - 0.01).all()
            for other in others
        ), name


def eye(reach: float, up: str = "+z", position: tuple[str, ...] = ("nav.outputs.place",)) -> np.ndarray:
    """Where the first page looks from, and at: shape (2, 3)."""
    nav = Signals("nav", "/m/nav", False, {"place": 3, "turned": 4}, {"place": "m"})
    views = Views((), Body("rover", 2.0, position, "nav.outputs.turned", "", up, ""))
    stage = Scene(rr.RecordingStream("test"), Cast("/m", [nav], [], (), views))
    controls = Plan(stage.cast, stage.world, (0.0, 1.0), reach)._vehicle().properties["EyeControls3D"]
    return np.concatenate([numbers(controls.position), numbers(controls.look_target)])


def test_the_whole_flight_is_seen_from_the_side_however_far_it_goes() -> None:
    near, far = eye(10.0), eye(1000.0)
    assert far == pytest.approx(100 * near)
    assert np.linalg.norm(near[0] - near[1]) > 10.0 and near[0][2] > 0.0 and near[1].tolist() == [0.0, 0.0, 5.0]
    assert eye(10.0, up="-z") == pytest.approx(near * (1, 1, -1))
    assert eye(0.0) == pytest.approx(eye(8.0))  # four times the vehicle at least


def test_a_vehicle_that_stays_is_seen_from_near() -> None:
    position, target = eye(1000.0, position=())
    assert target.tolist() == [0.0, 0.0, 0.0] and 2.0 < np.linalg.norm(position) < 6.0
