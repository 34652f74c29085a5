# SPDX-License-Identifier: Apache-2.0
"""The `views` block: the panels, the body and the frames that a machine or a simulation chooses for its pictures.

It comes as text from a bag, from telemetry or from a file of the user, so it is checked as hostile input.
"""

from __future__ import annotations

import json
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..errors import ViewError, did_you_mean

#: What a curve is, in the order in which a panel lists its curves.
ROLES = ("truth", "measured", "estimate", "command", "values")
SHAPES = ("lander", "multirotor", "fixed_wing", "rover", "satellite", "mesh")
MESH_SUFFIXES = (".glb", ".stl", ".obj")
#: Limits of a block. A file around it (a machine JSON) may be larger.
TEXT_BYTES_MAX, FILE_BYTES_MAX = (1 << 16) - 1, 4 * 1024 * 1024
PANELS_MAX, CURVES_MAX, FRAMES_MAX = 16, 8, 64
_NAME_CHARACTERS_MAX = 400
_SIZE_M, _LANDER_SIZE_M = 1.0, 3.0
_STEP = r"[^\s.\[\]]+(?:\[[0-9]+\])*"
_PATH = re.compile(rf"{_STEP}(?:\.{_STEP})*?\.(?:inputs|outputs|parameters|state)(?:\.{_STEP})+")


@dataclass(frozen=True)
class Curve:
    """A value to draw: the path of a number, a boolean or an array, and its role (one of ROLES)."""

    path: str
    role: str


@dataclass(frozen=True)
class PanelView:
    """Curves with one vertical axis. With `angles` each is a quaternion, drawn as roll, pitch and yaw in degrees."""

    title: str
    angles: bool
    curves: tuple[Curve, ...]


@dataclass(frozen=True)
class Body:
    """The vehicle in 3D. `size` is its largest extent in m.

    `position`: the path of an array of 3, or for each axis the path of a scalar or a constant, in m. `attitude`: the
    path of a quaternion. `thrust`: that of an array of 3 in N (body axes) or of a scalar along the body's upward axis.
    All may be empty, but not both of the first. `up` is "+z", or "-z" where z points down in world and body. `mesh` is
    the file of the shape `mesh`.
    """

    shape: str
    size: float
    position: tuple[str | float, ...]
    attitude: str
    thrust: str
    up: str
    mesh: str


@dataclass(frozen=True)
class Frame:
    """A frame, placed in that of its parent: position in m, rotation w, x, y, z. Names may be any text."""

    frame: str
    parent: str
    position: tuple[float, ...]
    rotation: tuple[float, ...]


@dataclass(frozen=True)
class Views:
    panels: tuple[PanelView, ...]
    body: Body | None
    frames: tuple[Frame, ...] = ()


def parse_views(text: str) -> Views:
    """The block that `text` holds. Raises ViewError, whose message is one sentence with the place."""
    if len(text.encode("utf-8", "replace")) > TEXT_BYTES_MAX:
        raise ViewError(f"views: more than {TEXT_BYTES_MAX} bytes")
    return _views(_json(text, "views"))


def views_or_remark(text: str) -> tuple[Views | None, str]:
    """The block of a recording or of telemetry, and "": None without one, and for an invalid one, with the reason."""
    try:
        return (parse_views(text) if text else None), ""
    except ViewError as error:
        return None, f"the views of the run ({error})"


def read_views(file: str | Path) -> Views:
    """The block of a machine JSON, of a simulation JSON, or of a file that is the block itself. Raises ViewError."""
    path = Path(file)
    try:
        with path.open("rb") as stream:
            raw = stream.read(FILE_BYTES_MAX + 1)
    except OSError as error:
        raise ViewError(f"{file}: {error.strerror}") from None
    if len(raw) > FILE_BYTES_MAX:
        raise ViewError(f"{file}: more than {FILE_BYTES_MAX} bytes")
    try:
        block = _json(raw.decode("utf-8"), "the file")
        if isinstance(block, dict) and "panels" not in block and "body" not in block:
            if "views" not in block and isinstance(block.get("extends"), str):
                raise ViewError(f'no member "views": it extends "{block["extends"]}"; name the file that has them')
            if "views" not in block:
                raise ViewError('no member "views", and not such a block itself: {"panels": […], "body": {…}}')
            block = block["views"]
        if (
            isinstance(block, dict)
            and isinstance(block.get("body"), dict)
            and isinstance(block["body"].get("mesh"), str)
        ):
            block["body"]["mesh"] = str(path.absolute().parent / block["body"]["mesh"])
        return _views(block)
    except UnicodeDecodeError:
        raise ViewError(f"{file}: not a JSON file") from None
    except ViewError as error:
        raise ViewError(f"{file}: {error}") from None


def _json(text: str, what: str) -> Any:
    try:
        return json.loads(text, object_pairs_hook=_without_repeats, parse_constant=_refuse_constant)
    except RecursionError:
        raise ViewError(f"{what}: nested too deeply") from None
    except ValueError as error:
        raise ViewError(f"{what}: not valid JSON: {error}") from None


def _without_repeats(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    members = dict(pairs)
    if len(members) != len(pairs):
        raise ValueError("a key appears twice in one object")
    return members


def _refuse_constant(name: str) -> Any:
    raise ValueError(f"{name} is not a number of JSON")


def _views(block: Any) -> Views:
    members = _object(block, "views", ("panels", "body", "frames"))
    panels = [
        _panel(panel, f"views.panels[{i}]")
        for i, panel in enumerate(_list(members.get("panels", []), "views.panels", PANELS_MAX))
    ]
    body = _body(members["body"]) if members.get("body") is not None else None
    if not panels and body is None:
        raise ViewError('views: holds neither "panels" nor a "body"')
    frames = _list(members.get("frames", []), "views.frames", FRAMES_MAX)
    return Views(tuple(panels), body, tuple(_frame(frame, f"views.frames[{i}]") for i, frame in enumerate(frames)))


def _frame(value: Any, where: str) -> Frame:
    """The compiler makes a rotation of `rpy`; pictures show no frames, so that of a JSON file is passed over."""
    members = _object(value, where, ("frame", "parent", "position", "rotation", "rpy"))
    name, parent = (_text(members.get(key, ""), f"{where}.{key}") for key in ("frame", "parent"))
    position, rotation = (
        tuple(
            _number(n, f"{where}.{key}", -1e9) for n in _list(members.get(key, default), f"{where}.{key}", len(default))
        )
        for key, default in (("position", [0.0] * 3), ("rotation", [1.0, 0.0, 0.0, 0.0]))
    )
    if len(position) != 3 or len(rotation) != 4:
        raise ViewError(f"{where}: a position has 3 numbers, a rotation 4")
    return Frame(name, parent, position, rotation)


def _panel(value: Any, where: str) -> PanelView:
    members = _object(value, where, ("title", "angles", *ROLES))
    angles = members.get("angles", False)
    if not isinstance(angles, bool):
        raise ViewError(f"{where}.angles: not true or false")
    curves = [
        Curve(_path(path, f"{where}.{role}[{i}]"), role)
        for role in ROLES
        for i, path in enumerate(_list(members.get(role, []), f"{where}.{role}", CURVES_MAX))
    ]
    if not curves:
        raise ViewError(f'{where}: has no curve; expected for example "values": ["nav.outputs.altitude"]')
    if len(curves) > CURVES_MAX:
        raise ViewError(f"{where}: {len(curves)} curves; at most {CURVES_MAX} fit in a panel")
    return PanelView(_text(members.get("title", ""), f"{where}.title"), angles, tuple(curves))


def _body(value: Any) -> Body:
    where = "views.body"
    members = _object(value, where, ("shape", "size", "position", "attitude", "thrust", "up", "mesh"))
    shape = members.get("shape")
    if shape not in SHAPES:
        raise ViewError(f"{where}.shape: not one of {', '.join(SHAPES)}")
    size = _number(members.get("size", _LANDER_SIZE_M if shape == "lander" else _SIZE_M), f"{where}.size", 0.001)
    up = members.get("up", "+z")
    if up not in ("+z", "-z"):
        raise ViewError(f'{where}.up: not "+z" or "-z"')
    mesh = _text(members.get("mesh") or "", f"{where}.mesh")
    if (shape == "mesh") != bool(mesh):
        raise ViewError(f'{where}.mesh: the file of "shape": "mesh", and of no other shape')
    if mesh and Path(mesh).suffix.lower() not in MESH_SUFFIXES:
        raise ViewError(f"{where}.mesh: the name of a mesh ends in {', '.join(MESH_SUFFIXES)}")
    position = _position(members["position"], f"{where}.position") if "position" in members else ()
    attitude, thrust = (
        _path(members[key], f"{where}.{key}") if members.get(key) else "" for key in ("attitude", "thrust")
    )
    if not position and not attitude:
        raise ViewError(f"{where}: has neither position nor attitude")
    return Body(str(shape), size, position, attitude, thrust, str(up), mesh)


def _position(value: Any, where: str) -> tuple[str | float, ...]:
    if isinstance(value, str):
        return (_path(value, where),)
    places = _list(value, where, 3)
    if len(places) != 3:
        raise ViewError(f"{where}: not one path of an array of 3, or three paths or numbers")
    return tuple(
        _path(place, f"{where}[{i}]") if isinstance(place, str) else _number(place, f"{where}[{i}]", -1e9)
        for i, place in enumerate(places)
    )


def _number(value: Any, where: str, least: float) -> float:
    """A finite number from `least` to 1e9."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not least <= value <= 1e9:
        raise ViewError(f"{where}: not a number from {least:g} to 1e9")
    return float(value)


def _object(value: Any, where: str, known: tuple[str, ...]) -> Mapping[str, Any]:
    if not isinstance(value, dict):
        raise ViewError(f"{where}: not an object with {', '.join(known)}")
    for key in value:
        if key not in known:
            named = key[:80] if key[:80].isprintable() else ascii(key[:80])
            raise ViewError(f"{where}: no key `{named}`{did_you_mean(named, known)}; there are {', '.join(known)}")
    return value


def _list(value: Any, where: str, most: int) -> list[Any]:
    if not isinstance(value, list):
        raise ViewError(f"{where}: not a list")
    if len(value) > most:
        raise ViewError(f"{where}: {len(value)} elements; at most {most} are allowed")
    return value


def _text(value: Any, where: str) -> str:
    if not isinstance(value, str) or not (value.isprintable() or not value) or len(value) > _NAME_CHARACTERS_MAX:
        raise ViewError(f"{where}: not a text of at most {_NAME_CHARACTERS_MAX} printable characters")
    return value


def _path(value: Any, where: str) -> str:
    path = _text(value, where)
    if not _PATH.fullmatch(path):
        raise ViewError(f"{where}: not a path like `nav.outputs.altitude`")
    return path
