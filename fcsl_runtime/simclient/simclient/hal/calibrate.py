# SPDX-License-Identifier: Apache-2.0
"""`fcsl hal calibrate`: measures what corrects a device of a sensor, and writes it into the board's JSON."""

from __future__ import annotations

import json
from collections.abc import Callable

from .board_edit import Changes
from .board_file import Target, find_target
from .calibrate_accel import SECONDS as ACCEL_SECONDS
from .calibrate_accel import calibrate_accel
from .calibrate_compass import SECONDS as COMPASS_SECONDS
from .calibrate_compass import calibrate_compass
from .calibrate_gyro import SECONDS as GYRO_SECONDS
from .calibrate_gyro import calibrate_gyro
from .calibrate_rc import SECONDS as RC_SECONDS
from .calibrate_rc import calibrate_rc

#: The kind of sensor, what measures, and for how long unless the user says otherwise.
_CALIBRATIONS: dict[str, tuple[str, Callable[[Target, float], Changes], float]] = {
    "gyro": ("inertial", calibrate_gyro, GYRO_SECONDS),
    "accel": ("inertial", calibrate_accel, ACCEL_SECONDS),
    "compass": ("compass", calibrate_compass, COMPASS_SECONDS),
    "rc": ("rc", calibrate_rc, RC_SECONDS),
}


def calibrate(what: str, path: str, sensor: str, device: str | None, seconds: float | None, writes: bool) -> None:
    """Raises TwinError for a board that cannot be used, Refused for a calibration that is refused."""
    kind, measure, default_s = _CALIBRATIONS[what]
    target = find_target(path, sensor, kind, device)
    changes = measure(target, default_s if seconds is None else seconds)
    name = target.backend.device.name
    if not writes:
        print(f"with --write, the backend `{name}` of sensor `{sensor}` in {path} would get")
        print(json.dumps(changes))
        return
    target.write(changes)
    print(f"written into the backend `{name}` of sensor `{sensor}` in {path}; now run `fcsl board {path}`")
