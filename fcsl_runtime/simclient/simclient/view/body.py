# SPDX-License-Identifier: Apache-2.0
"""Bodies of vehicles in 3D: simple shapes of a given size, or the mesh of a file. x is ahead, z up."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr

from .mesh import extent_of
from .views import Body

_BODY_COLOUR, _PART_COLOUR, _FRONT_COLOUR = (214, 214, 220), (120, 120, 128), (235, 120, 40)
_PANEL_COLOUR = (40, 70, 150)


def log_body(stream: rr.RecordingStream, entity: str, body: Body) -> str:
    """Logs the body below `entity`. Returns a remark if its mesh cannot be shown, so that a box takes its place."""
    down = body.up == "-z"
    turned = {"rotation_axis_angle": rr.RotationAxisAngle((1, 0, 0), degrees=180)} if down else {}
    remark = ""
    if body.shape == "mesh":
        try:
            scale = body.size / extent_of(Path(body.mesh))
            asset = rr.Asset3D(path=body.mesh)
        except (OSError, ValueError) as error:
            remark = f"{body.mesh} ({error}; a box takes its place)"
            stream.log(entity, rr.Transform3D(scale=body.size), static=True)
            stream.log(f"{entity}/box", _boxes([(0, 0, 0)], [(1, 0.6, 0.4)]), static=True)
        else:
            # A mesh has the axes of the vehicle itself, whichever of them points up.
            stream.log(entity, rr.Transform3D(scale=scale), static=True)
            stream.log(f"{entity}/mesh", asset, static=True)
        return remark
    stream.log(entity, rr.Transform3D(scale=body.size, **turned), static=True)
    for name, part in _PARTS[body.shape]().items():
        stream.log(f"{entity}/{name}", part, static=True)
    return remark


#: Height of each shape's top above its origin, in sizes: thrust has its arrow there, where nothing hides it.
TOPS = {"lander": 0.76, "multirotor": 0.06, "fixed_wing": 0.05, "rover": 0.34, "satellite": 0.1, "mesh": 0.0}

Parts = dict[str, rr.AsComponents]


def _boxes(centres: list[tuple[float, float, float]], sizes: list[tuple[float, float, float]],
           colour: tuple[int, int, int] = _BODY_COLOUR) -> rr.Boxes3D:  # fmt: skip
    return rr.Boxes3D(centers=centres, sizes=sizes, colors=[colour] * len(sizes), fill_mode="solid")


def _lander() -> Parts:
    """Stands on its origin, on four legs."""
    feet = [[0.5 * np.cos(a), 0.5 * np.sin(a), 0.0] for a in np.arange(4) * np.pi / 2 + np.pi / 4]
    legs = [[[foot[0] / 2, foot[1] / 2, 0.4], foot] for foot in feet]
    hull = rr.Cylinders3D(
        lengths=[0.45], radii=[0.28], centers=[[0, 0, 0.53]], colors=[_BODY_COLOUR], fill_mode="solid"
    )
    return {"hull": hull, "legs": rr.LineStrips3D(legs, radii=0.022, colors=[_PART_COLOUR])}


def _multirotor() -> Parts:
    """Four rotors in a cross; the front ones have another colour."""
    tips = [(0.35 * np.cos(a), 0.35 * np.sin(a), 0.05) for a in np.arange(4) * np.pi / 2 + np.pi / 4]
    arms = [[(0.0, 0.0, 0.0), tip] for tip in tips]
    colours = [_FRONT_COLOUR if tip[0] > 0 else _PART_COLOUR for tip in tips]
    return {
        "hull": _boxes([(0, 0, 0)], [(0.24, 0.16, 0.1)]),
        "arms": rr.LineStrips3D(arms, radii=0.015, colors=[_BODY_COLOUR]),
        "rotors": rr.Cylinders3D(lengths=[0.02] * 4, radii=[0.15] * 4, centers=tips, colors=colours, fill_mode="solid"),
    }


def _fixed_wing() -> Parts:
    return {
        "hull": _boxes([(0.05, 0, 0)], [(0.8, 0.1, 0.1)]),
        "nose": _boxes([(0.47, 0, 0)], [(0.06, 0.08, 0.08)], _FRONT_COLOUR),
        "wings": _boxes([(0.1, 0, 0.03), (-0.33, 0, 0.03)], [(0.18, 1.0, 0.02), (0.1, 0.36, 0.02)], _PART_COLOUR),
        "fin": _boxes([(-0.33, 0, 0.12)], [(0.1, 0.02, 0.16)], _PART_COLOUR),
    }


def _rover() -> Parts:
    """Four wheels stand on the plane of its origin."""
    wheels = [(x, y, 0.14) for x in (-0.3, 0.3) for y in (-0.28, 0.28)]
    across = [rr.RotationAxisAngle((1, 0, 0), degrees=90)] * 4
    tyres = rr.Cylinders3D(
        lengths=[0.1] * 4,
        radii=[0.14] * 4,
        centers=wheels,
        rotation_axis_angles=across,
        colors=[_PART_COLOUR] * 4,
        fill_mode="solid",
    )
    return {
        "hull": _boxes([(0, 0, 0.24)], [(0.84, 0.44, 0.2)]),
        "front": _boxes([(0.44, 0, 0.24)], [(0.06, 0.4, 0.16)], _FRONT_COLOUR),
        "wheels": tyres,
    }


def _satellite() -> Parts:
    """Solar panels along y, an antenna ahead."""
    return {
        "hull": _boxes([(0, 0, 0)], [(0.24, 0.2, 0.2)]),
        "panels": _boxes([(0, -0.31, 0), (0, 0.31, 0)], [(0.2, 0.38, 0.01)] * 2, _PANEL_COLOUR),
        "antenna": rr.LineStrips3D([[(0.12, 0, 0), (0.3, 0, 0)]], radii=0.015, colors=[_FRONT_COLOUR]),
    }


_PARTS = {
    "lander": _lander,
    "multirotor": _multirotor,
    "fixed_wing": _fixed_wing,
    "rover": _rover,
    "satellite": _satellite,
}
