# SPDX-License-Identifier: Apache-2.0
"""`fcsl plot X.sim.json`: the picture of a simulation that is run for it. simclient.view.picture draws."""

from __future__ import annotations

import tempfile
from collections.abc import Sequence
from pathlib import Path

from simclient.errors import BagError, ViewError

from .config import SimConfig
from .errors import SimError
from .runner import run

#: Those of simclient.view.picture, which takes a second to import.
PICTURE_SUFFIXES = (".png", ".svg", ".pdf")


def picture_name(config: str, output: Path | None) -> Path:
    """The picture to write: by default the simulation's name with .png, in this folder. Raises SimError, before a long run,
    for a name that is none of a picture, and for a bag."""
    if Path(config).is_dir() or config.endswith(".mcap"):
        raise SimError(f"{config} is no simulation; `fcsl plot` draws bags, too")
    name = output or Path(f"{_stem(config)}.png")
    if name.suffix.lower() not in PICTURE_SUFFIXES:
        raise SimError(f"{name}: the name of a picture ends in {', '.join(PICTURE_SUFFIXES)}")
    return name


def draw(config: SimConfig, output: Path, paths: Sequence[str], against: str) -> list[str]:
    """Runs the simulation, recorded into a temporary bag, and draws it. Returns what is left out. Raises SimError."""
    from simclient.view.picture import plot  # imported here, because it takes a second

    channels = {c.name: c.field.path for c in config.machine.channels if c.direction == "actuator"}
    with tempfile.TemporaryDirectory(prefix="fcsl-sim-plot-") as folder:
        bag = Path(folder) / _stem(config.path.name)  # the picture's title names it
        run(config, bag=bag)
        try:
            return plot(bag, output, paths=paths, against=against, channels=channels)
        except (BagError, ViewError) as error:
            raise SimError(str(error)) from None


def _stem(config: str) -> str:
    name = Path(config).name
    return name.removesuffix(".sim.json") if name.endswith(".sim.json") else Path(name).stem
