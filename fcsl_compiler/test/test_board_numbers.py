# SPDX-License-Identifier: Apache-2.0
"""Rotations, corrections and filters of boards against SciPy."""

import ctypes
import math
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from fcsl_test_boards import edited, write_board, write_machine
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import signal
from scipy.spatial.transform import Rotation

from fcsl_compiler.board.board import check_board
from fcsl_compiler.board.corrections import Correction
from fcsl_compiler.board.filters import Section, low_pass, notch
from fcsl_compiler.board.pulses import MAX_NUMBER, Line
from fcsl_compiler.board.rotations import IDENTITY, NAMED, determinant, from_angles, matrix_problem
from fcsl_compiler.driver.toolchain import compiler

TOP = ("sensors", "imu", "backends", 0)
angles = st.floats(-180.0, 180.0)


def rows(matrix: tuple[float, ...]) -> Any:
    return np.reshape(matrix, (3, 3))


# ---- rotations -------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", NAMED)
def test_named_rotations(name: str) -> None:
    """SciPy's lower-case axes are fixed ones: first about x, then y, then z."""
    expected = Rotation.from_euler("xyz", NAMED[name], degrees=True).as_matrix()
    matrix = from_angles(*NAMED[name])
    np.testing.assert_allclose(rows(matrix), expected, atol=1e-15)
    assert matrix_problem(matrix) == ""
    if all(angle % 90 == 0 for angle in NAMED[name]):
        assert all(
            value in (-1.0, 0.0, 1.0) and math.copysign(1.0, value) == (-1.0 if value < 0 else 1.0) for value in matrix
        )


@pytest.mark.parametrize(
    ("name", "rotated"),
    [
        ("none", (1, 2, 3)),
        ("yaw_90", (-2, 1, 3)),
        ("roll_180", (1, -2, -3)),
        ("pitch_270", (-3, 2, 1)),
        ("roll_180_yaw_90", (2, 1, -3)),
        ("roll_90_yaw_90", (3, 1, 2)),
        ("roll_90_pitch_90", (2, -3, -1)),
        ("roll_90_pitch_180_yaw_90", (3, -1, -2)),
    ],
)
def test_rotated_vector(name: str, rotated: tuple[int, ...]) -> None:
    """What the vector (1, 2, 3) of a device is in the axes of the body; as in ArduPilot's vector3.cpp."""
    assert tuple(rows(from_angles(*NAMED[name])) @ (1, 2, 3)) == rotated


def test_names_of_rotations() -> None:
    assert len(NAMED) == 512
    assert {"none", "yaw_45", "roll_180_yaw_225", "pitch_315", "roll_90_pitch_180_yaw_90"} < NAMED.keys()


@given(angles, angles, angles, st.floats(0.0, 9e-8))
def test_rotations_are_accepted(roll: float, pitch: float, yaw: float, rounding: float) -> None:
    """As written with seven digits."""
    matrix = Rotation.from_euler("xyz", (roll, pitch, yaw), degrees=True).as_matrix() + rounding
    assert matrix_problem(tuple(matrix.flat)) == ""


@given(angles, angles, angles, st.floats(1e-5, 2.0), st.integers(0, 2), st.integers(0, 2))
def test_other_matrices_are_refused(roll: float, pitch: float, yaw: float, by: float, i: int, j: int) -> None:
    matrix = Rotation.from_euler("xyz", (roll, pitch, yaw), degrees=True).as_matrix()
    assert matrix_problem(tuple((-matrix).flat)) == "its determinant is -1: it is a reflection"
    scaled = matrix.copy()
    scaled[i] *= 1.0 + by
    assert matrix_problem(tuple(scaled.flat)).startswith(f"row {i + 1} has the length")
    if i != j:
        tilted = matrix.copy()
        tilted[i] += by * tilted[j]
        tilted[i] /= np.linalg.norm(tilted[i])
        assert "are not orthogonal" in matrix_problem(tuple(tilted.flat))


@given(st.lists(st.floats(-100.0, 100.0), min_size=9, max_size=9))
def test_determinant(elements: list[float]) -> None:
    assert determinant(tuple(elements)) == pytest.approx(np.linalg.det(rows(tuple(elements))), rel=1e-9, abs=1e-6)


# ---- corrections -----------------------------------------------------------------------------------------------------


def correction(folder: Path, quantity: str, rotation: Any, entry: dict[str, Any]) -> Correction:
    write_machine(folder)
    backend = {"device": "imu_top", "rotation": rotation, "correct": {quantity: entry}}
    board = check_board(write_board(folder, edited(*TOP, value=backend)))
    return board.sensors[0].backends[0].corrections[quantity]


@pytest.mark.parametrize(
    ("scale", "matrix"),
    [
        (2, np.eye(3) * 2),
        ([1, 2, -3], np.diag([1, 2, -3])),
        ([[1, 0.1, 0], [0, 2, 0.2], [0.3, 0, 3]], np.array([[1, 0.1, 0], [0, 2, 0.2], [0.3, 0, 3]])),
    ],
    ids=["number", "axes", "matrix"],
)
def test_correction_of_a_vector(scale: Any, matrix: Any, tmp_path: Path) -> None:
    """The device's axes are scaled, then rotated."""
    found = correction(tmp_path, "gyro", "roll_45_yaw_90", {"scale": scale, "offset": [1, 2, 3]})
    rotation = Rotation.from_euler("xyz", (45, 0, 90), degrees=True).as_matrix()
    np.testing.assert_allclose(rows(found.matrix), rotation @ matrix, atol=1e-15)
    assert (found.offset, found.per_kelvin, found.celsius) == ((1.0, 2.0, 3.0), (0.0, 0.0, 0.0), 25.0)


def test_correction_of_a_scalar(tmp_path: Path) -> None:
    """A rotation leaves it alone."""
    found = correction(tmp_path, "temperature", "yaw_90", {"scale": 2, "offset": -1.5})
    assert found.matrix == (2.0, *IDENTITY[1:]) and found.offset == (-1.5, 0.0, 0.0)


def test_correction_with_the_temperature(tmp_path: Path) -> None:
    found = correction(tmp_path, "accel", "none", {"per_kelvin": [1, 2, 3], "celsius": -10})
    assert (found.matrix, found.per_kelvin, found.celsius) == (IDENTITY, (1.0, 2.0, 3.0), -10.0)


# ---- filters ---------------------------------------------------------------------------------------------------------

#: Part of the rate, in the range that a board can have.
fractions = st.floats(1e-3, 0.49)
rates_hz = st.floats(1.0, 1e5)


def transfer(section: Section) -> tuple[list[float], list[float]]:
    return [section.b0, section.b1, section.b2], [1.0, section.a1, section.a2]


def gain(section: Section, hz: float, rate_hz: float) -> float:
    _, response = signal.freqz(*transfer(section), worN=[hz], fs=rate_hz)
    return float(abs(response[0]))


@settings(max_examples=200)
@given(fractions, rates_hz)
def test_low_pass(fraction: float, rate_hz: float) -> None:
    hz = fraction * rate_hz
    section = low_pass(hz, rate_hz)
    for own, scipys in zip(transfer(section), signal.butter(2, hz, fs=rate_hz), strict=True):
        np.testing.assert_allclose(own, scipys, rtol=1e-9, atol=1e-13)
    assert gain(section, hz, rate_hz) == pytest.approx(math.sqrt(0.5), rel=1e-6)


@settings(max_examples=200)
@given(fractions, st.floats(0.05, 1.9), rates_hz)
def test_notch(fraction: float, relative_width: float, rate_hz: float) -> None:
    hz = fraction * rate_hz
    width_hz = min(relative_width * hz, 1.9 * (0.5 * rate_hz - hz))
    section = notch(hz, width_hz, rate_hz)
    for own, scipys in zip(transfer(section), signal.iirnotch(hz, hz / width_hz, fs=rate_hz), strict=True):
        np.testing.assert_allclose(own, scipys, rtol=1e-9, atol=1e-13)
    assert gain(section, hz, rate_hz) < 1e-6 and gain(section, 0.0, rate_hz) == pytest.approx(1.0, rel=1e-6)


def test_slowest_filter_is_precise() -> None:
    """At rest a value passes unchanged, though 1/10000 of the rate needs most digits of a double."""
    section = low_pass(0.1, 1000.0)
    steady = (section.b0 + section.b1 + section.b2) / (1.0 + section.a1 + section.a2)
    assert steady == pytest.approx(1.0, abs=1e-8)


def test_sections_of_a_backend(tmp_path: Path) -> None:
    """Low-passes, then notches, each for the rate of the device."""
    write_machine(tmp_path)
    imu = check_board(write_board(tmp_path, edited(*TOP, "rotation", value="none"))).sensors[0]
    for backend, rate_hz in zip(imu.backends, (1000.0, 500.0, 400.5), strict=True):
        assert backend.sections == (
            ("gyro", low_pass(80.0, rate_hz)),
            ("accel", low_pass(40.0, rate_hz)),
            ("gyro", notch(120.0, 20.0, rate_hz)),
        )


# ---- outputs ---------------------------------------------------------------------------------------------------------

ROOT = Path(__file__).parents[2]
RUNTIME = ROOT / "fcsl_runtime" / "fcsl_runtime"
INCLUDES = (RUNTIME, RUNTIME / "include", ROOT / "fcsl_hal" / "include", ROOT / "fcsl_compiler" / "include")
numbers = st.floats(-MAX_NUMBER, MAX_NUMBER)


class RuntimePulse(ctypes.Structure):
    """board_pulse_t."""

    _fields_ = [
        ("signal", ctypes.c_char_p),
        ("index", ctypes.c_uint32),
        *((name, ctypes.c_double) for name in ("low", "high", "minimum", "middle", "maximum", "slew", "safe")),
    ]


@pytest.fixture(scope="module")
def runtime(tmp_path_factory: pytest.TempPathFactory) -> Callable[[Line, float], float]:
    """The pulse of a command as the guard computes it."""
    library = tmp_path_factory.mktemp("map") / "map.so"
    source = RUNTIME / "board" / "output_map.c"
    options = ["-std=c11", "-O2", "-shared", "-fPIC", *(f"-I{folder}" for folder in INCLUDES)]
    subprocess.run([*compiler(), *options, str(source), "-o", str(library), "-lm"], check=True)
    functions = ctypes.CDLL(str(library))
    functions.output_map_pulse.restype = ctypes.c_double
    functions.output_map_flaw.restype = ctypes.c_char_p

    def pulse(line: Line, command: float) -> float:
        rule = RuntimePulse(b"", 0, line.low, line.high, line.minimum, line.middle, line.maximum, 0.0, line.middle)
        assert functions.output_map_flaw(ctypes.byref(rule)) is None
        return float(functions.output_map_pulse(ctypes.byref(rule), ctypes.c_double(command)))

    return pulse


@settings(max_examples=500)
@given(
    st.tuples(numbers, numbers).filter(lambda ends: ends[0] != ends[1]),
    st.tuples(numbers, numbers, numbers),
    st.booleans(),
    numbers,
)
@example(ends=(-1.0, 1.0), outputs=(952.9, 2043.8, 2100.0), is_reversed=False, command=-1e-17)  # rounds beyond its end
def test_outputs_are_those_of_the_runtime(
    runtime: Callable[[Line, float], float],
    ends: tuple[float, float],
    outputs: tuple[float, ...],
    is_reversed: bool,
    command: float,
) -> None:
    line = Line(*sorted(ends), *sorted(outputs, reverse=is_reversed))
    for value in (command, *ends, line.low + 0.3 * (line.high - line.low)):
        assert line.at(value) == runtime(line, value)
        assert line.contains(line.at(value))


@pytest.mark.parametrize(
    ("command", "output"),
    [(-5.0, 1900.0), (-1.0, 1900.0), (-0.5, 1650.0), (0.0, 1400.0), (0.5, 1250.0), (1.0, 1100.0), (7.0, 1100.0)],
)
def test_an_output_with_a_trim(command: float, output: float) -> None:
    assert Line(-1.0, 1.0, 1900.0, 1400.0, 1100.0).at(command) == output
