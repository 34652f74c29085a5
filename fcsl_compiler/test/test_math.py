# SPDX-License-Identifier: Apache-2.0
"""fcsl_math exports its functions, calls only exact ones, and has C's special values. test_rounding.py tests its
results."""

import ctypes
import math
import subprocess
from pathlib import Path

from fcsl_test_points import ONE_ARGUMENT, TWO_ARGUMENTS

from fcsl_compiler.base.packages import package_prefix
from fcsl_compiler.driver.symbols import ALLOWED
from fcsl_compiler.driver.toolchain import link_shared

LIBRARIES = package_prefix("fcsl_compiler") / "lib"


def test_special_values() -> None:
    library = ctypes.CDLL(str(LIBRARIES / "libfcsl_math.so"))

    def call(name: str, *arguments: float) -> float:
        function = getattr(library, f"cr_{name}")
        function.argtypes, function.restype = [ctypes.c_double] * len(arguments), ctypes.c_double
        return float(function(*arguments))

    assert math.copysign(1, call("sin", -0.0)) == -1
    assert math.isnan(call("sin", math.inf)) and math.isnan(call("log", -1.0)) and math.isnan(call("acos", 1.5))
    assert call("log", 0.0) == -math.inf and call("exp", 1000.0) == math.inf and call("exp", -1000.0) == 0.0
    assert call("atan2", 0.0, -1.0) == math.pi and call("atan2", -0.0, -1.0) == -math.pi
    assert call("pow", 0.0, 0.0) == 1.0 and call("hypot", math.inf, math.nan) == math.inf


def symbols(path: Path, *options: str) -> list[tuple[str, str]]:
    listing = subprocess.run(["nm", *options, path], capture_output=True, text=True, check=True).stdout
    return [(words[-2], words[-1]) for line in listing.splitlines() if len(words := line.split()) >= 2]


def test_calls_only_exact_functions() -> None:
    found = symbols(LIBRARIES / "libfcsl_math.a")
    defined = {name for kind, name in found if kind not in "Uw"}
    undefined = {name for kind, name in found if kind in "Uw"} - defined - {"_GLOBAL_OFFSET_TABLE_"}
    assert undefined <= ALLOWED, f"not allowed: {sorted(undefined - ALLOWED)}"


def test_exports_every_function_and_nothing_else() -> None:
    exported = {name for kind, name in symbols(LIBRARIES / "libfcsl_math.so", "-D", "--defined-only") if kind == "T"}
    assert exported == {f"cr_{name}{suffix}" for name in (*ONE_ARGUMENT, *TWO_ARGUMENTS) for suffix in ("", "f")}


def test_a_machine_exports_no_math_functions(tmp_path: Path) -> None:
    """If they were exported, another library of the process with the same names could replace them."""
    source, library = tmp_path / "probe.c", tmp_path / "libprobe.so"
    shown = '__attribute__((visibility("default")))'
    source.write_text(f"double cr_sin(double);\n{shown} double probe(double x) {{ return cr_sin(x); }}\n")
    link_shared([source], [], library)
    assert {name for _, name in symbols(library, "-D", "--defined-only")} == {"probe"}
