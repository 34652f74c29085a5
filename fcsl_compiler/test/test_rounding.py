# SPDX-License-Identifier: Apache-2.0
"""Every elementary function of libfcsl_math is correctly rounded at 100 000 difficult points each.

FCSL_VERIFY=1 uses mpmath at every point (minutes), otherwise only where long double is not conclusive (seconds).
"""

import ctypes
import os

import numpy as np
import pytest
from fcsl_test_points import ONE_ARGUMENT, TWO_ARGUMENTS, Doubles, points
from fcsl_test_rounding import misrounded

from fcsl_compiler.base.packages import package_prefix

FUNCTIONS = (*ONE_ARGUMENT, *TWO_ARGUMENTS)
POINTS = 100_000
SCREEN = os.environ.get("FCSL_VERIFY", "") in ("", "0")


@pytest.fixture(scope="module")
def library() -> ctypes.CDLL:
    return ctypes.CDLL(str(package_prefix("fcsl_compiler") / "lib" / "libfcsl_math.so"))


def evaluate(library: ctypes.CDLL, name: str, arguments: tuple[Doubles, ...], *, single: bool) -> Doubles:
    function = getattr(library, f"cr_{name}" + ("f" if single else ""))
    scalar = ctypes.c_float if single else ctypes.c_double
    function.argtypes, function.restype = [scalar] * len(arguments), scalar
    return np.array([function(*row) for row in zip(*(a.tolist() for a in arguments), strict=True)])


@pytest.mark.parametrize("single", [False, True], ids=["binary64", "binary32"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_correctly_rounded(library: ctypes.CDLL, name: str, single: bool) -> None:
    arguments = points(name, POINTS, single=single)
    results = evaluate(library, name, arguments, single=single)
    finite = results[np.isfinite(results)]
    # Check of the points: few NaNs and infinities, many different results.
    assert results.size >= POINTS and finite.size > 0.7 * POINTS and np.unique(finite).size > 0.3 * POINTS
    wrong = misrounded(name, arguments, results, single=single, screen=SCREEN)
    shown = [(*(float(a[i]).hex() for a in arguments), float(results[i]).hex()) for i in wrong[:3]]
    assert not wrong, f"{len(wrong)} of {results.size} misrounded, first: {shown}"


@pytest.mark.parametrize("screen", [False, True], ids=["mpmath", "screened"])
@pytest.mark.parametrize("single", [False, True], ids=["binary64", "binary32"])
@pytest.mark.parametrize("name", FUNCTIONS)
def test_the_check_detects_every_error_of_one_unit(library: ctypes.CDLL, name: str, single: bool, screen: bool) -> None:
    """Results changed by one unit in the last place are all found, with and without the screen. The correct ones all
    pass."""
    few = tuple(a[:: POINTS // 200] for a in points(name, POINTS, single=single))
    results = evaluate(library, name, few, single=single)
    kept = np.isfinite(results) & np.all([np.isfinite(a) for a in few], axis=0)
    few, results = tuple(a[kept] for a in few), results[kept]
    assert misrounded(name, few, results, single=single, screen=screen) == []
    moved = np.nextafter(results.astype(np.float32 if single else np.float64), 9.0).astype(np.float64)
    assert misrounded(name, few, moved, single=single, screen=screen) == list(range(len(moved)))
