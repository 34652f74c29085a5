#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Parsers of receivers (UBX, NMEA 0183, SBUS, CRSF, TFmini) under Frama-C's EVA, and seeded defects that it must find.

    python3 scripts/verify receivers

program.c puts each parser into any state and gives it any byte. There must be no alarm, EVA must follow each loop to its
end, and what program.c asserts must hold.
"""

from __future__ import annotations

import sys
from pathlib import Path

from ..eva.handwritten import Defect, Proof, check
from ..shared.cases import ROOT
from ..shared.effort import scaled

#: Of the loop that looks for a frame; at most as many as a stream has bytes. What they cost grows with their square.
_TURNS = scaled(256, 1024)
#: Values that `//@ split` analyses by themselves: those of a length within a stream.
_LENGTHS = 1025
#: Functions whose paths stay apart, at most so many: a number is tied to its digits, and a result to what it says.
_PATHS = {
    **{"read_decimal": 3000, "read_angle": 3000, "read_time": 400, "read_triple": 20, "read_rmc": 20},
    **{f"{name}_take": 20 for name in ("gnss_ubx", "gnss_nmea", "rc_sbus", "rc_crsf", "tfmini")},
    **{f"take_{name}": 20 for name in ("ubx", "nmea", "sbus", "crsf", "tfmini")},
}
PROOF = Proof(
    "receivers",
    Path(__file__).resolve().parent / "program.c",
    ROOT / "fcsl_hal/src",
    (
        "serial/byte_stream.c",
        *(f"drivers/gnss/{name}.c" for name in ("gnss_fix", "gnss_nmea", "gnss_ubx")),
        *(f"drivers/rc/{name}.c" for name in ("rc_channels", "rc_crsf", "rc_sbus")),
        "drivers/tfmini/tfmini.c",
    ),
    (f"-DTURNS={_TURNS}",),
    (
        *("-eva-split-limit", str(_LENGTHS), "-eva-plevel", "300", "-eva-split-return", "auto"),
        *("-eva-slevel-function", ",".join(f"{name}:{paths}" for name, paths in _PATHS.items())),
        *("-eva-split-return-function", "read_decimal:full,rc_crsf_take:full"),
    ),
    loops_end=True,
)


def defect(what: str, part: str, file: str, old: str, new: str) -> Defect:
    """EVA must find it in this part of the program, with fewer turns to count."""
    source = next(name for name in PROOF.sources if Path(name).stem == file)
    return Defect(what, source, old, new, (f"-DPARTS={part}", "-DTURNS=64"))


DEFECTS = (
    defect("a full stream takes another byte", "STREAM", "byte_stream", "stream->size == BYTE_STREAM_MAX", "0"),
    defect("more is dropped than there is", "STREAM", "byte_stream", "if (count >= stream->size) {", "if (0) {"),
    defect("a byte is garbage twice", "END", "byte_stream", "stream->garbage++;", "stream->garbage += 2u;"),
    defect("UBX: the sum reaches behind the message", "UBX", "gnss_ubx", "i < length - 2u", "i <= length"),
    defect("UBX: a year whose nanoseconds 64 bits do not hold", "UBX", "gnss_ubx", "year > YEAR_MAX", "0"),
    defect("NMEA: a sentence shorter than its end", "NMEA", "gnss_nmea", "length < TAIL + 1u || ", ""),
    defect("NMEA: more fields than there is room for", "NMEA", "gnss_nmea", "sentence.count < FIELDS_MAX", "1"),
    defect("NMEA: more digits than 64 bits hold", "NMEA", "gnss_nmea", "digits < DIGITS_MAX", "1"),
    defect("NMEA: an angle with too many decimals", "NMEA", "gnss_nmea", "decimal.whole < 0 || decimal.scale > NS_PER_S",
           "decimal.whole < 0"),
    defect("NMEA: a count of satellites as it comes", "NMEA", "gnss_nmea", "whole <= 255 ?", "1 ?"),
    defect("SBUS: a channel more than there is room for", "SBUS", "rc_sbus", "pulse_us[17]", "pulse_us[18]"),
    defect("CRSF: a length too short for type and CRC", "CRSF", "rc_crsf", "length < LENGTH_MIN || ", ""),
    defect("CRSF: a sum longer than the longest frame", "CRSF", "rc_crsf", " || length > LENGTH_MAX", ""),
    defect("TFmini: a sum that reaches behind the stream", "TFMINI", "tfmini", "i < SUM", "i <= BYTE_STREAM_MAX"),
)  # fmt: skip

if __name__ == "__main__":
    sys.exit(check(PROOF, DEFECTS))
