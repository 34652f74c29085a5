# SPDX-License-Identifier: Apache-2.0
"""What `fcsl response` prints and writes; response_picture.py draws."""

from __future__ import annotations

import cmath
import json
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from ..errors import SimError
from ..plot import PICTURE_SUFFIXES
from .response import Margins, Point, Response, margins


def heading(response: Response) -> str:
    """Of the table whose rows are `row`."""
    columns = ["loop", "sensitivity", *(path for path, _ in response.outputs)]
    names = "  ".join(f"{_short(name):>18}" for name in columns)
    return f"{'rad/s':>9}  {names}   change    rest"


def row(point: Point) -> str:
    """Frequency; gain (dB) and phase (degrees) of the loop, the sensitivity and each output; how well they are settled, and
    what is left. Or why nothing was measured."""
    if not point.is_settled:
        return f"{point.omega:9.4g}  not measured: {point.why}"
    loop = [point.loop, point.sensitivity] if point.has_loop else [0j, 0j]
    cells = "  ".join(_cell(value) for value in [*loop, *map(point.response, range(len(point.outputs)))])
    return f"{point.omega:9.4g}  {cells}  {point.change:7.0e} {point.rest:7.0e}"


def _cell(value: complex) -> str:
    """`none`: it does not depend on the sine."""
    return f"{decibels(value):8.2f} dB {math.degrees(cmath.phase(value)):5.0f}°" if value else f"{'none':>18}"


def _short(name: str) -> str:
    return name if len(name) <= 18 else f"…{name[-17:]}"


def decibels(value: complex) -> float:
    """Of a value that is not 0."""
    return 20.0 * math.log10(abs(value))


def check_picture(path: Path) -> None:
    """Raises SimError, before a long run, for a name that is none of a picture."""
    if path.suffix.lower() not in PICTURE_SUFFIXES:
        raise SimError(f"{path}: the name of a picture ends in {', '.join(PICTURE_SUFFIXES)}")


class Measured:
    """A whole response: its points, and the margins of the loop."""

    def __init__(self, response: Response, points: Sequence[Point]):
        self.inputs = [(injection.path, injection.weight) for injection in response.injections]
        self.outputs, self.within = response.outputs, response.within
        self.requested = list(points)
        #: Those that were measured.
        self.points = [point for point in points if point.is_settled]
        #: None: what the source gives does not depend on the sine, there is no loop; or nothing was measured.
        self.margins: Margins | None = margins(points) if any(point.has_loop for point in points) else None

    def text(self) -> str:
        lines = [_margins_text(self.margins)] if self.margins else []
        if self.points and not self.margins:
            lines.append("no loop: the source does not depend on the sine")
        elif any(not point.has_loop for point in self.points):
            names = _names(point for point in self.points if not point.has_loop)
            lines.append(f"no loop at {names} rad/s: there the source does not depend on the sine")
        if not self.points:
            lines.append("nothing was measured")
        elif len(self.points) < len(self.requested):
            names = _names(point for point in self.requested if not point.is_settled)
            lines.append(f"not measured at {names} rad/s: what is said above is of the other {len(self.points)}")
        return "\n".join(lines)

    def as_json(self) -> dict[str, Any]:
        def parts(values: Sequence[complex]) -> dict[str, list[float]]:
            return {"real": [v.real for v in values], "imag": [v.imag for v in values]}

        return {
            "inputs": [{"path": path, "weight": weight} for path, weight in self.inputs],
            "within": self.within,
            "omega": [point.omega for point in self.points],
            "loop": parts([point.loop for point in self.points]),
            "sensitivity": parts([point.sensitivity for point in self.points]),
            "responses": {
                path: {"unit": unit, **parts([point.response(i) for point in self.points])}
                for i, (path, unit) in enumerate(self.outputs)
            },
            "change": [point.change for point in self.points],
            "rest": [point.rest for point in self.points],
            "margins": vars(self.margins) if self.margins else None,
            "not_measured": [
                {"omega": point.omega, "why": point.why} for point in self.requested if not point.is_settled
            ],
        }

    def write(self, path: Path) -> None:
        path.write_text(json.dumps(self.as_json(), indent=1) + "\n")


def _margins_text(found: Margins) -> str:
    lines = [phase_text(found) if found.gain_crossover else "", gain_text(found) if found.gain_margin else ""]
    return "\n".join(filter(None, [*lines, peak_text(found)]))


def phase_text(found: Margins) -> str:
    if found.phase_margin is None or found.gain_crossover is None:
        return "no gain crossover where it was measured"
    return (
        f"phase margin {math.degrees(found.phase_margin):.1f}° at {found.gain_crossover:.4g} rad/s, "
        f"delay margin {1e3 * (found.delay_margin or 0.0):.3g} ms"
    )


def gain_text(found: Margins) -> str:
    if found.gain_margin is None:
        return "no phase crossover where it was measured"
    return f"gain margin {decibels(found.gain_margin):.1f} dB ({found.gain_margin:.3g}) at {found.phase_crossover:.4g} rad/s"


def peak_text(found: Margins) -> str:
    size = f"{found.peak_sensitivity:.3g} ({decibels(found.peak_sensitivity):.1f} dB)"
    return f"largest sensitivity {size} at {found.peak_frequency:.4g} rad/s"


def _names(points: Iterable[Point]) -> str:
    return ", ".join(f"{point.omega:.4g}" for point in points)
