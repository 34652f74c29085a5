# SPDX-License-Identifier: Apache-2.0
"""The compilers of each backend."""

from __future__ import annotations

from .nim import nim_toolchain
from .toolchain import toolchain


def toolchain_of_backend(backend: str) -> str:
    """Versions and flags of its compilers, as included in build_hash. Raises ToolchainError."""
    return nim_toolchain() if backend == "nim" else toolchain()
