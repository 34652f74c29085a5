# SPDX-License-Identifier: Apache-2.0
"""The simulator, which needs this package and registers its parts here: entry points of the group `simclient.simulation`.

twin        the module of SimTwin and SimBlackBox
campaign    the module of Flights
"""

from __future__ import annotations

from functools import cache
from importlib.metadata import entry_points
from typing import Any

_GROUP = "simclient.simulation"


@cache
def simulation_part(part: str, what: str) -> Any:
    """The module registered as `part`, where `what` is. Raises ImportError, which says what is missing."""
    for point in entry_points(group=_GROUP, name=part):
        try:
            return point.load()
        except ModuleNotFoundError as error:  # what a removed package leaves behind still names it
            if error.name not in (point.module, point.module.partition(".")[0]):
                raise
    fix = "build it (colcon build --packages-up-to fcsl_sim) and source the workspace's setup.bash"
    raise ImportError(f"{what} is in the package `fcsl_sim`, which this environment does not have: {fix}")
