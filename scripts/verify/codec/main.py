#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Codec, COBS, CRCs and frames of the link under Frama-C's EVA, and seeded defects that it must find.

    python3 scripts/verify codec

program.c hands them any bytes of every size up to 44, and frames of the largest size; its memory ends where the bytes end.
There must be no alarm, and what it asserts must hold.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ..eva.handwritten import Defect, Proof, check
from ..shared.cases import ROOT

PROOF = Proof(
    "codec",
    Path(__file__).resolve().parent / "program.c",
    ROOT / "fcsl_hal/src",
    ("codec/codec.c", "codec/codec_check.c", "codec/crc32.c", "link/crc16.c", "link/cobs.c", "link/link_frame.c"),
)


def defect(what: str, file: str, old: str, new: str, sizes: tuple[int, int] = (44, 44)) -> Defect:
    """EVA must find it with bytes of these sizes."""
    return Defect(what, file, old, new, (f"-DSMALLEST={sizes[0]}", f"-DLARGEST={sizes[1]}"))


CHECK, ENCODE, COBS, FRAME = "codec/codec_check.c", "codec/codec.c", "link/cobs.c", "link/link_frame.c"
DEFECTS = (
    defect("an entry may end behind its message", CHECK, "if (behind > end) {", "if (0) {"),
    defect("the count of an array is not compared", CHECK, "entry->values + *size == entry->end", "entry->end > 0"),
    defect("a message shorter than its head is read", CHECK, "size < head_bytes(kind) + CRC_BYTES", "size < CRC_BYTES",
           (12, 12)),
    defect("bytes that change after the check are believed", CHECK,
           "values == NULL || is_no_rotation", "values != NULL && is_no_rotation"),
    defect("values are stored beside their field", CHECK, "scalars_import(data + field->offset,",
           "scalars_import(data + field->offset + 1,"),
    defect("no room is kept for the CRC", ENCODE, "*at < size + CRC_BYTES", "*at < size"),
    defect("the last bytes of a message are summed as eight", "codec/crc32.c", "i + 8u <= size", "i < size", (37, 37)),
    defect("the last bytes of a frame are summed as eight", "link/crc16.c", "i + 8u <= size", "i < size"),
    defect("a frame may grow without end", COBS, "at < end && size < FCSL_LINK_FRAME_MAX", "at < end"),
    defect("a frame shorter than its header is read", FRAME, "size < begin + FCSL_LINK_CRC_BYTES", "0", (8, 8)),
)  # fmt: skip

if __name__ == "__main__":
    sys.exit(check(PROOF, DEFECTS))
