# SPDX-License-Identifier: Apache-2.0
"""Compass against fields that SciPy turns into the body's axes."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

#: Of the Earth at 52 N, 4 E: north, east, down.
FIELD = np.array([1.91568e-05, 8.549e-07, 4.55784e-05])
DECLINATION = float(np.arctan2(FIELD[1], FIELD[0]))
TO_ENU = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, -1.0]])
SOFT = np.array([[0.05, 0.02, -0.01], [0.02, -0.04, 0.03], [-0.01, 0.03, 0.02]])
ANGLES = [[0.4, 0.2, -0.3], [-3.0, -1.0, 0.5], [1.6, 0.0, 2.0], [3.1, 0.7, -1.4]]


def compass(block: Callable[..., Any], **more: Any) -> Any:
    return block("compass.py", "Compass", declination=DECLINATION, **more)


def seen(r: Rotation, field: Any = FIELD, z_down: bool = True, **more: Any) -> dict[str, Any]:
    world = field if z_down else TO_ENU @ field
    force = r.inv().apply([0.0, 0.0, -9.8 if z_down else 9.8])
    inputs = {"field": r.inv().apply(world), "specific_force": force} | more
    return {n: np.asarray(v).tolist() for n, v in inputs.items()} | {"field_fresh": True}


@pytest.mark.parametrize("z_down", [True, False])
@pytest.mark.parametrize("angles", ANGLES)
def test_the_heading_is_that_of_the_body(block: Callable[..., Any], angles: list[float], z_down: bool) -> None:
    """Also at rest, by gravity, and with an estimated heading that is wrong."""
    c, r = compass(block, z_down=z_down), Rotation.from_euler("ZYX", angles)
    inputs = seen(r, z_down=z_down)
    wrong = (Rotation.from_euler("z", 0.9) * r).as_quat(scalar_first=True).tolist()
    for more in (
        {"attitude": [1.0, 0.0, 0.0, 0.0], "attitude_valid": False},
        {"attitude": wrong, "attitude_valid": True},
    ):
        out = c.step(**inputs, **more)
        assert out["fresh"] and out["health"] == "nominal"
        assert out["heading"] == pytest.approx(angles[0], abs=1e-12)
    out = c.step(field_fresh=False)
    assert not out["fresh"] and out["heading"] == pytest.approx(angles[0], abs=1e-12)


def test_iron_is_taken_off(block: Callable[..., Any]) -> None:
    hard = np.array([2e-6, -3e-6, 1e-6])
    c = compass(block, hard_iron=hard.tolist(), soft_iron=SOFT.tolist())
    r = Rotation.from_euler("ZYX", ANGLES[0])
    raw = np.linalg.solve(np.eye(3) + SOFT, r.inv().apply(FIELD)) + hard
    assert c.step(**seen(r) | {"field": raw.tolist()})["heading"] == pytest.approx(ANGLES[0][0], abs=1e-12)


def test_an_error_of_the_tilt_turns_it_by_the_dip(block: Callable[..., Any]) -> None:
    c, tilt = compass(block), 1e-4
    dip = FIELD[2] / np.hypot(FIELD[0], FIELD[1])
    r = Rotation.from_euler("z", DECLINATION)  # towards magnetic north: a roll is across the field
    q = (r * Rotation.from_euler("x", tilt)).as_quat(scalar_first=True).tolist()
    out = c.step(**seen(r), attitude=q, attitude_valid=True)
    assert abs(out["heading"] - DECLINATION) == pytest.approx(dip * tilt, rel=1e-3) and dip == pytest.approx(
        2.4, abs=0.1
    )


def test_no_heading_along_the_vertical(block: Callable[..., Any]) -> None:
    c = compass(block)
    for pitch, fresh in ((1.4, True), (1.5, False), (1.5708, False), (-1.5, False)):
        r = Rotation.from_euler("ZYX", [0.4, pitch, 0.2])
        out = c.step(**seen(r), attitude=r.as_quat(scalar_first=True).tolist(), attitude_valid=True)
        assert (out["fresh"], out["health"]) == (fresh, "nominal" if fresh else "degraded")
        assert out["heading"] == pytest.approx(0.4, abs=1e-9)


@pytest.mark.parametrize(
    "field",
    [
        FIELD * 1.31,
        FIELD * 0.69,
        FIELD * [1.0, float("nan"), 1.0],
        FIELD * [1.0, float("inf"), 1.0],
        [0.0, 0.0, 4.9e-5],
    ],
    ids=["strong", "weak", "nan", "infinite", "vertical"],
)
def test_what_cannot_be_used_is_passed_over(block: Callable[..., Any], field: Any) -> None:
    c, r = compass(block, strength=float(np.linalg.norm(FIELD))), Rotation.identity()
    good = c.step(**seen(r, FIELD * 1.29))
    assert good["fresh"] and good["health"] == "nominal"
    out = c.step(**seen(r) | {"field": np.asarray(field).tolist()})
    assert out == good | {"fresh": False, "health": "degraded"}
    assert c.native.get_value("block.counters.faults") == 0
