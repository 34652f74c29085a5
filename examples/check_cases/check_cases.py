# SPDX-License-Identifier: Apache-2.0
"""Flies NASA's atmospheric check-cases 1 to 10 and writes their histories in the report's variables and units.

python3 check_cases.py -o histories                      # Atmos_01_fcsl.csv … Atmos_10_fcsl.csv
python3 check_cases.py -o histories --against NASA_CSVS  # also compares with Atmos_NN_sim_KK.csv in that folder
"""

from __future__ import annotations

import argparse
import csv
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from simclient import SimTwin

CASES = range(1, 11)
WINDS = {6: "still air", 7: "steady wind", 8: "wind shear"}
AXES = ("Roll", "Pitch", "Yaw")
SIM = Path(__file__).with_name("sim")
FOOT = 0.3048
SLUG = 14.593902937206364829  # kg
POUND = SLUG * FOOT  # N
KNOT = 1852 / 3600

#: Columns of the report (table 75): the field, the unit in SI, and the axes where it is a vector.
VARIABLES = {
    "eiPosition_ft": ("body.outputs.position_inertial", FOOT, "XYZ"),
    "gePosition_ft": ("earth.outputs.position_ecef", FOOT, "XYZ"),
    "eiVelocity_ft_s": ("body.outputs.velocity_inertial", FOOT, "XYZ"),
    "feVelocity_ft_s": ("earth.outputs.velocity_ned", FOOT, "XYZ"),
    "altitudeMsl_ft": ("earth.outputs.height", FOOT, ""),
    "longitude_deg": ("earth.outputs.longitude", np.pi / 180, ""),
    "latitude_deg": ("earth.outputs.latitude", np.pi / 180, ""),
    "localGravity_ft_s2": ("earth.outputs.gravity", FOOT, ""),
    "eulerAngle_deg_Yaw": ("euler.outputs.yaw", np.pi / 180, ""),
    "eulerAngle_deg_Pitch": ("euler.outputs.pitch", np.pi / 180, ""),
    "eulerAngle_deg_Roll": ("euler.outputs.roll", np.pi / 180, ""),
    "bodyAngularRateWrtEi_deg_s": ("body.outputs.rate_body", np.pi / 180, ("Roll", "Pitch", "Yaw")),
    "speedOfSound_ft_s": ("atmosphere.outputs.speed_of_sound", FOOT, ""),
    "airDensity_slug_ft3": ("atmosphere.outputs.density", SLUG / FOOT**3, ""),
    "ambientPressure_lbf_ft2": ("atmosphere.outputs.pressure", POUND / FOOT**2, ""),
    "ambientTemperature_dgR": ("atmosphere.outputs.temperature", 5 / 9, ""),
    "aero_bodyForce_lbf": ("drag.outputs.force_body", POUND, "XYZ"),
    "aero_bodyMoment_ftlbf": ("damping.outputs.torque_body", POUND * FOOT, "LMN"),
    "mach": ("air.outputs.mach", 1.0, ""),
    "dynamicPressure_lbf_ft2": ("air.outputs.dynamic_pressure", POUND / FOOT**2, ""),
    "trueAirspeed_nmi_h": ("air.outputs.airspeed", KNOT, ""),
}


def fly(case: int) -> dict[str, np.ndarray]:
    """The columns of the case, at 0, 0.1, … 30 s."""
    with SimTwin.from_config(SIM / f"case_{case:02}.sim.json") as twin:
        with twin.trace(*[path for path, _, _ in VARIABLES.values()]) as trace:
            twin.tick(301)
        columns = {"time": np.arange(301) / 10}
        for name, (path, unit, axes) in VARIABLES.items():
            for axis, values in zip(axes or [""], np.atleast_2d(trace[path].T), strict=True):
                columns[f"{name}_{axis}" if axis else name] = values / unit
    columns["altitudeRateWrtMsl_ft_min"] = -60 * columns["feVelocity_ft_s_Z"]
    return columns


def write(columns: dict[str, np.ndarray], path: Path) -> None:
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(zip(*(map(repr, values.tolist()) for values in columns.values()), strict=True))


def read(path: Path) -> dict[str, np.ndarray]:
    """A history of the report; the first of columns with one name."""
    with path.open(newline="") as stream:
        names, *rows = csv.reader(stream)
    table = np.array(rows, dtype=float).T
    return {name: table[names.index(name)] for name in names}


def compare(case: int, own: dict[str, np.ndarray], published: Path) -> Iterator[tuple[str, float, float]]:
    """Of each column: the largest distance from the mean of the report's simulations, and the largest of any of these."""
    histories = [read(path) for path in sorted(published.glob(f"Atmos_{case:02}_sim_*.csv"))]
    for name, values in own.items():
        others = [np.interp(own["time"], h["time"], h[name]) for h in histories if name in h]
        if name != "time" and others:
            mean = np.mean(others, axis=0)
            yield name, np.abs(values - mean).max(), max(np.abs(other - mean).max() for other in others)


def plot(flown: dict[int, dict[str, np.ndarray]], path: Path) -> None:
    """What the cases differ in: falls with and without drag, wind, the brick, the cannonballs."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(10, 7), layout="constrained")
    panels = [
        ("height, ft", [(1, "altitudeMsl_ft", "1: no drag"), (6, "altitudeMsl_ft", "6: drag")]),
        ("velocity to the east, ft/s", [(c, "feVelocity_ft_s_Y", f"{c}: {w}") for c, w in WINDS.items()]),
        (
            "rates of the brick, deg/s",
            [(c, f"bodyAngularRateWrtEi_deg_s_{a}", f"{c}: {a}") for c in (2, 3) for a in AXES],
        ),
        ("height, ft", [(9, "altitudeMsl_ft", "9: to the east"), (10, "altitudeMsl_ft", "10: to the north")]),
    ]
    for number, (title, curves) in enumerate(panels, start=1):
        axes = figure.add_subplot(2, 2, number)
        for case, column, label in curves:
            axes.plot(flown[case]["time"], flown[case][column], label=label)
        axes.set_xlabel("time, s")
        axes.set_ylabel(title)
        axes.grid(alpha=0.3)
        axes.legend(fontsize=8)
    figure.savefig(path, dpi=80, metadata={"Software": ""})


def main(arguments: Sequence[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description="flies NASA's atmospheric check-cases 1 to 10")
    parser.add_argument("-o", "--output", type=Path, default=Path("histories"), help="folder of the CSV files")
    parser.add_argument("--against", type=Path, help="folder with the report's Atmos_NN_sim_KK.csv")
    parser.add_argument("--plot", type=Path, metavar="FILE", help="also draw some of the histories (.png)")
    options = parser.parse_args(arguments)
    if options.against and not any(options.against.glob("Atmos_*_sim_*.csv")):
        print(f"{options.against}: no Atmos_NN_sim_KK.csv in it", file=sys.stderr)
        return 2
    options.output.mkdir(parents=True, exist_ok=True)
    flown = {}
    for case in CASES:
        columns = flown[case] = fly(case)
        path = options.output / f"Atmos_{case:02}_fcsl.csv"
        write(columns, path)
        print(f"{path}: {columns['altitudeMsl_ft'][-1]:.5f} ft after 30 s")
        if options.against:
            for name, distance, spread in compare(case, columns, options.against):
                note = "" if distance <= spread else "  beyond the spread"
                print(f"  {name:36} {distance:11.3g} from the mean, spread {spread:9.3g}{note}")
    if options.plot:
        plot(flown, options.plot)
    return 0


if __name__ == "__main__":
    sys.exit(main())
