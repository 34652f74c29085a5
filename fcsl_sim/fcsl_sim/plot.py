# SPDX-License-Identifier: Apache-2.0
"""`fcsl plot`: the picture of a simulation that is run for it, or of a bag. simclient.view.picture draws."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from simclient.errors import BagError, ViewError

from .config import SimConfig
from .errors import SimError
from .runner import run

_SUFFIX = ".sim.json"
#: Those of simclient.view.picture, which takes a second to import.
PICTURE_SUFFIXES = (".png", ".svg", ".pdf")


@dataclass(frozen=True)
class Picture:
    """`left_out`: what of the views could not be drawn; `damage`: why the bag is incomplete, empty if it is whole."""

    path: Path
    left_out: list[str]
    damage: str


def is_bag(target: str) -> bool:
    """Whether a target is a bag and not a simulation: a directory, or an .mcap file."""
    return not target.startswith("package://") and (Path(target).is_dir() or target.endswith(".mcap"))


def draw(
    target: str, output: Path | None, paths: Sequence[str], against: str, load: Callable[[], SimConfig]
) -> Picture:
    """Draws a bag, or the run of the simulation that `load` reads, recorded into a temporary bag. output: by default
    the target's name with .png, in this folder. Raises SimError and DiagnosticError."""
    stem = Path(target).name.removesuffix(_SUFFIX).removesuffix(".mcap") or "bag"
    written = output or Path(f"{stem}.png")
    if written.suffix.lower() not in PICTURE_SUFFIXES:  # before a long run
        raise SimError(f"{written}: the name of a picture ends in {', '.join(PICTURE_SUFFIXES)}")
    if is_bag(target):
        return _draw(Path(target), written, paths, against)
    with tempfile.TemporaryDirectory(prefix="fcsl-sim-plot-") as folder:
        bag = Path(folder) / stem  # the picture's title names it
        run(load(), bag=bag)
        return _draw(bag, written, paths, against)


def _draw(path: Path, output: Path, paths: Sequence[str], against: str) -> Picture:
    # Imported here, because the imports take a second.
    from simclient.bag import Bag
    from simclient.view.picture import plot

    try:
        bag = Bag(path)
        left_out = plot(bag, output, paths=paths, against=against)
        return Picture(output, left_out, bag.truncated)
    except (BagError, ViewError) as error:
        raise SimError(str(error)) from None
