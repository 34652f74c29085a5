#!/usr/bin/env python3
# SPDX-License-Identifier: Apache-2.0
"""Processor in the loop: the lander's controller on a Cortex-M7 (QEMU), its plant here; the flight is that of one process.

It is what `fcsl sim --pil qemu:mps2-an500` does (docs/hardware/firmware.md): the plant's truth of every tick and all fields of the
controller are compared. The control: a controller with the last bit of one parameter changed flies another flight.
"""

from __future__ import annotations

import argparse
import shutil
import sys
from pathlib import Path

from fcsl_sim import SimError, load
from fcsl_sim.pil import compare

from ..shared.cases import EXAMPLES, OUT, ROOT, CheckFailed, write_facts

SIMULATION = ROOT / "examples" / "lander" / "sim" / "lander.sim.json"
PROCESSOR = "qemu:mps2-an500"
_CHANGE = ('"accel_sigma": 0.5}', '"accel_sigma": 0.5000000000000001}')
_TIMEOUT_MS = 60_000


def changed_machine() -> Path:
    """The lander's controller with another parameter. Raises CheckFailed."""
    original = EXAMPLES["lander_control"]
    folder = OUT / "pil" / "changed"
    shutil.rmtree(folder, ignore_errors=True)
    shutil.copytree(original.parent, folder)
    text = original.read_text()
    if _CHANGE[0] not in text:
        raise CheckFailed(f"{original}: no `{_CHANGE[0]}` to change; the control needs another one")
    (folder / original.name).write_text(text.replace(*_CHANGE))
    return folder / original.name


def check() -> None:
    """Raises CheckFailed, SimError."""
    config = load(SIMULATION)
    found = compare(config, PROCESSOR, _TIMEOUT_MS)
    for place, flight in (("in one process", found.here), ("on a Cortex-M7", found.there)):
        print(f"pil: {place}: {len(flight.truth)} ticks, truth {flight.digest}, fields {flight.fields}", flush=True)
    if found.difference:
        raise CheckFailed(f"{found.difference}: the check `bits` tells which target differs")
    if not compare(config, PROCESSOR, _TIMEOUT_MS, changed_machine()).difference:
        raise CheckFailed(
            "control: a controller with another parameter flies the same flight: this check finds nothing"
        )
    print("pil: control: the last bit of one parameter changes the flight")
    ticks, seconds = len(found.there.truth), found.there.seconds
    print(f"{'exchanges a second, Cortex-M7':<36} {ticks / seconds:,.0f}")
    write_facts("pil", {"ticks": ticks, "truth": found.here.digest, "fields": found.here.fields, "seconds": seconds})


def main() -> int:
    about, _, more = (__doc__ or "").partition("\n\n")
    argparse.ArgumentParser(description=about, epilog=more).parse_args()
    try:
        check()
    except (CheckFailed, SimError) as error:
        print(f"pil: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
