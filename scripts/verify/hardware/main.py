# SPDX-License-Identifier: Apache-2.0
"""What `make hardware` tries, where its kernel is built; EFFORT=full builds it."""

from __future__ import annotations

import subprocess
import sys

from ..shared.cases import ROOT
from ..shared.effort import scaled

LEFT_OUT = 77  # of checks.py


def main() -> int:
    build = [str(ROOT / "scripts/hardware/build.sh"), *scaled(["--if-built"], [])]
    built = subprocess.run(build, stdout=subprocess.DEVNULL, check=False)
    if built.returncode != 0:
        print("the kernel is not built: `make hardware` builds it once", flush=True)
        return LEFT_OUT if built.returncode == LEFT_OUT else built.returncode
    return subprocess.run([sys.executable, ROOT / "scripts/hardware"], check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
