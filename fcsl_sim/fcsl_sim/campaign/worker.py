# SPDX-License-Identifier: Apache-2.0
"""A process that flies cases: reads lines `[FIRST, COUNT, GAINS]` from standard input and writes an outcome per case, as a line
of JSON, to the file descriptor that it is given.

    python3 -m fcsl_sim.campaign.worker STUDY CASES PARAMETERS DESCRIPTOR
"""

from __future__ import annotations

import ctypes
import json
import os
import signal
import sys
import time
from dataclasses import astuple
from pathlib import Path

from fcsl_compiler.api.diagnostics import DiagnosticError
from simclient.errors import TwinError

from ..errors import SimError
from .flight import Flights, Outcome

_PR_SET_PDEATHSIG = 1
#: What a worker says before its first case.
READY = "ready"
#: Outcomes are held back so long, so that short flights do not wake the campaign each.
_HOLD_S = 0.02


def line_of(outcome: Outcome) -> str:
    """NaN and infinite numbers as Python writes and reads them."""
    return json.dumps(astuple(outcome))


def outcome_of(line: str) -> Outcome:
    case, seed, values, verdict, end, ticks, digest, metrics, error, failed_by = json.loads(line)
    return Outcome(case, seed, tuple(values), verdict, end, ticks, digest, tuple(metrics), error, failed_by)


def main(study: str, cases: str, parameters: str, descriptor: str) -> int:
    # A model that hangs must not outlive the campaign; Ctrl-C is the campaign's.
    ctypes.CDLL(None).prctl(_PR_SET_PDEATHSIG, signal.SIGKILL)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        flights = Flights.of(Path(study), None if cases == "-" else int(cases), parameters or None)
    except (DiagnosticError, SimError, TwinError, OSError) as error:
        print(f"fcsl-sim: error: {error}", file=sys.stderr)
        return 2
    with os.fdopen(int(descriptor), "w") as out:
        print(READY, file=out, flush=True)
        for line in sys.stdin:
            first, count, gains = json.loads(line)
            written = time.monotonic()
            for case in range(first, first + count):
                print(line_of(flights.fly(case, gains=gains)), file=out)
                if (now := time.monotonic()) > written + _HOLD_S:
                    written = now
                    out.flush()
            out.flush()
    flights.close()
    return 0


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
