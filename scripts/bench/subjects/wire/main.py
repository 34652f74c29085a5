# SPDX-License-Identifier: Apache-2.0
"""FCSL's messages of channels beside MAVLink 2, in C of pymavlink's mavgen: IMU and attitude of a tick, the commands of four
motors, all as f32. Bytes on the wire, ns to encode and to decode, messages that arrive when bits flip, corrupted frames that are
accepted.

    python3 scripts/bench wire        needs scripts/bench/harness/setup.sh
"""

from __future__ import annotations

import importlib.util
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from fcsl_compiler.driver.toolchain import include_dirs

from ...harness.native import compile_program
from ...harness.size import sized

HERE = Path(__file__).resolve().parent
BENCH = HERE.parents[1]
HAL = BENCH.parents[1] / "fcsl_hal"
DIALECT = BENCH / "peers/mavlink/bench.xml"
ROUNDS = sized(2000, 2)
#: Messages whose bits flip, and corrupted frames.
MESSAGES = sized(200_000, 1000)
FRAMES = sized(10_000_000, 100_000)


def generate(folder: Path) -> Path:
    """MAVLink's C for the dialect of its own and for the common messages; the folder to include from."""
    spec = importlib.util.find_spec("pymavlink")
    if spec is None or spec.origin is None:
        raise RuntimeError("pymavlink is not installed; scripts/bench/harness/setup.sh installs it")
    common = Path(spec.origin).parent / "dialects/v20/common.xml"
    output = folder / "mavlink"
    for dialect in (DIALECT, common):
        line = [sys.executable, "-m", "pymavlink.tools.mavgen", "--lang=C", "--wire-protocol=2.0", f"--output={output}"]
        subprocess.run([*line, str(dialect)], stdout=subprocess.PIPE, check=True)
    return output


def wire_figures(folder: Path) -> dict[str, Any]:
    mavlink = generate(folder)
    sources = [*sorted(HERE.glob("*.c")), BENCH / "harness/timing.c"]
    sources += [source for name in ("codec", "link") for source in sorted((HAL / "src" / name).glob("*.c"))]
    includes = [HERE, HAL / "include", HAL / "src", *include_dirs()]
    program = compile_program(sources, folder / "wire", includes, ["-isystem", str(mavlink)])
    line = [str(program), str(ROUNDS), str(MESSAGES), str(FRAMES)]
    done = subprocess.run(line, stdout=subprocess.PIPE, text=True, check=True)
    facts: dict[str, Any] = json.loads(done.stdout)
    return facts


def wire_rows(facts: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for direction, formats in facts["times"].items():
        for name, f in formats.items():
            figure = f"{f['bytes']} bytes, {f['encode_ns']:.0f} + {f['decode_ns']:.0f} ns"
            rows.append((f"{direction}: {name}", figure))
    for rate, formats in facts["flipped"].items():
        for name, f in formats.items():
            figure = f"{f['delivered']:.2%} arrive, {f['wrong']} wrong"
            rows.append((f"{float(rate):.2%} of bits flipped: {name}", figure))
    corrupted = facts["corrupted"]
    rows.append(("corrupted frames (2^-16 of them)", f"{corrupted['frames']} ({corrupted['frames'] / 65536:.0f})"))
    for title, name in (
        ("accepted by a link frame's CRC-16", "link_crc16"),
        ("... and by the message's CRC-32", "link_and_message"),
        ("messages accepted by their CRC-32 alone", "message_crc32"),
        ("accepted by a MAVLink parser", "mavlink"),
    ):
        rows.append((f"    {title}", str(corrupted[name])))
    return rows


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as scratch:
        figures = wire_figures(Path(scratch))
    print(json.dumps(figures))
    for what, figure in wire_rows(figures):
        print(f"{what:<60}{figure:>44}")
