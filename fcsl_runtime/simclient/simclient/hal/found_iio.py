# SPDX-License-Identifier: Apache-2.0
"""IIO devices of this computer. fcsl_hal/src/drivers/iio/iio.c has the same channels."""

from __future__ import annotations

import re
from pathlib import Path

from .found import Candidate, Found, first_unique
from .sysfs import attribute, folders, names_in

#: How the names of channels begin, and the signal of the drivers iio and iio_buffer.
_IIO_SIGNALS = {
    "in_anglvel": "gyro",
    "in_accel": "accel",
    "in_magn": "field",
    "in_pressure": "pressure",
    "in_temp": "temperature",
    "in_distance": "distance",
    "in_proximity": "distance",
    **{f"in_voltage{n}_": f"voltage{n}" for n in range(8)},
}
#: Where a chip is, which stays when the kernel numbers its devices anew: on an I2C or SPI bus.
_PLACE = re.compile(r"\d+-[0-9a-f]{4}|spi\d+\.\d+")
_POLLED_ENDS, _BUFFERED_ENDS = ("_raw", "_input"), ("_index",)
_DEFAULT_RATE = "100"
#: What the driver adc reads.
_COUNTS = re.compile(r"in_voltage(\d|1[0-5])_raw")


def _iio_signals(folder: Path, ends: tuple[str, ...]) -> list[str]:
    files = [name for name in names_in(folder) if name.endswith(ends)]
    signals = [signal for start, signal in _IIO_SIGNALS.items() if any(name.startswith(start) for name in files)]
    return list(dict.fromkeys(signals))


def _iio_rate(folder: Path) -> str:
    """The rate that the device has now, for the text of iio_buffer."""
    files = sorted(name for name in names_in(folder) if name.endswith("sampling_frequency"))
    for name in files:
        rate = attribute(folder, name)
        try:
            if float(rate) > 0.0:
                return f"{float(rate):g}"
        except ValueError:
            continue
    return _DEFAULT_RATE


def _place(folder: Path) -> str:
    """ "" if it is on no such bus."""
    owner = folder.resolve().parent.name
    return owner if _PLACE.fullmatch(owner) else ""


def find_iio() -> list[Found]:
    devices = folders("bus/iio/devices", "iio:device")
    names = {path: [attribute(path, "label"), attribute(path, "name"), _place(path), path.name] for path in devices}
    found = []
    for path in devices:
        device = first_unique(names[path], names.values())
        polled, buffered = _iio_signals(path, _POLLED_ENDS), _iio_signals(path / "scan_elements", _BUFFERED_ENDS)
        candidates = [Candidate("iio", device)] if polled else []
        if any(_COUNTS.fullmatch(name) for name in names_in(path)):
            candidates.append(Candidate("adc", device))
        if buffered:
            candidates.append(Candidate("iio_buffer", f"{device}@{_iio_rate(path)}"))
        measures = list(dict.fromkeys([*polled, *buffered]))
        name = " ".join(dict.fromkeys(text for text in (attribute(path, "name"), attribute(path, "label")) if text))
        found.append(
            Found("IIO device", name or path.name, str(path), measures, candidates, "no channel that a driver reads")
        )
    return found
