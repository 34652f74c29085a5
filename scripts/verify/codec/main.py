#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Codec, COBS, CRCs and frames of the link under Frama-C's EVA, and seeded defects that it must find.

    python3 scripts/verify codec

program.c hands them any bytes of every size up to 40, and frames of the largest size; its memory ends where the bytes end.
There must be no alarm, and what it asserts must hold.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

from fcsl_compiler.driver.toolchain import include_dirs

from ..eva.run import LIMIT_S, count_alarms, statements, unproven
from ..shared.cases import ROOT, CheckFailed, write_facts

HERE = Path(__file__).resolve().parent
SOURCES = ROOT / "fcsl_hal/src"
PROVED = ("codec.c", "codec_check.c", "crc32.c", "crc16.c", "cobs.c", "link_frame.c")
#: The model of the machine: LP64, little-endian, IEEE 754, as gcc on x86-64. Loops that EVA knows the rounds of are unrolled,
#: the longest over a whole frame; of the others the first rounds.
OPTIONS = (
    *("-machdep", "gcc_x86_64", "-kernel-warn-key", "parser:decimal-float=inactive"),
    *("-eva", "-eva-precision", "0", "-eva-msg-key=-initial-state,-final-states"),
    *("-eva-auto-loop-unroll", "260", "-eva-min-loop-unroll", "8"),
    *("-eva-no-builtins-auto", "-eva-builtin", "memcpy:Frama_C_memcpy,memset:Frama_C_memset,memchr:Frama_C_memchr"),
    *("-warn-special-float", "none", "-warn-right-shift-negative", "-warn-invalid-pointer"),
    "-eva-warn-pointer-subtraction",
)


@dataclass(frozen=True)
class Defect:
    """`old` of a source becomes `new`; EVA must find it with bytes of these sizes."""

    what: str
    file: str
    old: str
    new: str
    sizes: tuple[int, int] = (40, 40)


CHECK, ENCODE, COBS, FRAME = "codec_check.c", "codec.c", "cobs.c", "link_frame.c"
DEFECTS = (
    Defect("an entry may end behind its message", CHECK, "if (behind > end) {", "if (0) {"),
    Defect("the count of an array is not compared", CHECK, "entry->values + *size == entry->end", "entry->end > 0"),
    Defect("a message shorter than its head is read", CHECK, "size < head_bytes(kind) + CRC_BYTES", "size < CRC_BYTES",
           (12, 12)),
    Defect("bytes that change after the check are believed", CHECK,
           "    if (values == NULL) {\n        return;\n    }\n", ""),
    Defect("values are stored beside their field", CHECK, "scalars_import(data + field->offset,",
           "scalars_import(data + field->offset + 1,"),
    Defect("no room is kept for the CRC", ENCODE, "*at < size + CRC_BYTES", "*at < size"),
    Defect("the last bytes of a message are summed as eight", "crc32.c", "i + 8u <= size", "i < size", (37, 37)),
    Defect("the last bytes of a frame are summed as eight", "crc16.c", "i + 8u <= size", "i < size"),
    Defect("a frame may grow without end", COBS, "at < end && size < FCSL_LINK_FRAME_MAX", "at < end"),
    Defect("a frame shorter than its header is read", FRAME, "size < begin + FCSL_LINK_CRC_BYTES", "0", (8, 8)),
)  # fmt: skip


@dataclass(frozen=True)
class Analysis:
    """Of program.c and the sources; `unproven` are alarms and assertions, `silent` signs that code was not looked at."""

    reached: int
    statements: int
    unproven: tuple[str, ...]
    silent: tuple[str, ...]


def analyse(folder: Path, sources: Sequence[Path], defines: Sequence[str] = ()) -> Analysis:
    """Runs EVA on program.c with these sources. Raises CheckFailed when it does not come to an end."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "properties.csv"
    words = [*defines, *(f"-I{path}" for path in (ROOT / "fcsl_hal/include", *include_dirs(), SOURCES))]
    files = [str(path) for path in (HERE / "program.c", *sources)]
    line = ["frama-c", f"-cpp-extra-args={' '.join(words)}", *OPTIONS, *files]
    line += ["-then", "-metrics-eva-cover", "-report-csv", str(table)]
    try:
        done = subprocess.run(line, capture_output=True, text=True, check=False, timeout=LIMIT_S)
    except FileNotFoundError:
        raise CheckFailed("frama-c is not installed; scripts/verify_tools.sh installs it") from None
    except subprocess.TimeoutExpired:
        raise CheckFailed(f"EVA did not end within {LIMIT_S:.0f} s") from None
    if done.returncode != 0:
        raise CheckFailed(f"frama-c: exit status {done.returncode}\n{done.stdout[-3000:]}{done.stderr}")
    silent = []
    if "No errors or warnings raised during the analysis." not in done.stdout:
        silent.append("EVA warns of more than alarms")
    if "Unreached functions" in done.stdout:
        silent.append("EVA never reached " + done.stdout.partition("Unreached functions")[2].partition("\n[")[0])
    counts = statements(done.stdout).values()
    found = unproven(table, count_alarms(done.stdout))
    return Analysis(sum(n for n, _ in counts), sum(of for _, of in counts), tuple(found), tuple(silent))


def prove(folder: Path) -> Analysis:
    """Raises CheckFailed where something is not proven."""
    found = analyse(folder, [SOURCES / name for name in PROVED])
    if found.unproven or found.silent:
        raise CheckFailed("\n  ".join(("not proven:", *found.unproven, *found.silent)))
    return found


def find(defect: Defect, folder: Path) -> str:
    """What EVA no longer proves. Raises CheckFailed if it proves all."""
    text = (SOURCES / defect.file).read_text()
    if text.count(defect.old) != 1:
        raise CheckFailed(f"`{defect.old}` stands {text.count(defect.old)} times in {defect.file}; change this defect")
    folder.mkdir(parents=True)
    (folder / defect.file).write_text(text.replace(defect.old, defect.new))
    sources = [folder / name if name == defect.file else SOURCES / name for name in PROVED]
    smallest, largest = defect.sizes
    found = analyse(folder, sources, (f"-DSMALLEST={smallest}", f"-DLARGEST={largest}"))
    if not found.unproven:
        raise CheckFailed(f"not found: {defect.what}")
    return found.unproven[0]


def main() -> int:
    with tempfile.TemporaryDirectory(prefix="fcsl-codec-") as name, ThreadPoolExecutor(2) as pool:
        folder = Path(name)
        proof = pool.submit(prove, folder / "proof")
        controls = [pool.submit(find, defect, folder / str(n)) for n, defect in enumerate(DEFECTS)]
        try:
            for defect, control in zip(DEFECTS, controls, strict=True):
                print(f"found: {defect.what}: {control.result()}", flush=True)
            found = proof.result()
        except CheckFailed as error:
            for waiting in controls:
                waiting.cancel()
            print(f"codec: {error}", file=sys.stderr)
            return 1
    print(f"0 alarms; {found.reached} of {found.statements} statements reached", flush=True)
    facts = {"alarms": 0, "statements": found.statements, "statements_reached": found.reached}
    write_facts("codec", facts | {"defects found": len(DEFECTS)})
    return 0


if __name__ == "__main__":
    sys.exit(main())
