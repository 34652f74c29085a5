# SPDX-License-Identifier: Apache-2.0
"""The compilers of each backend. The cache asks for their versions alone, so that what makes code is not imported here."""

from __future__ import annotations

from .toolchain import Language, toolchain

#: No checks, no garbage collector, and no configuration but this.
_NIM_FLAGS = (
    "c",
    "--compileOnly",
    "--noMain",
    "--app:staticlib",
    "--mm:none",
    "-d:danger",
    "--threads:off",
    "--skipCfg",
    "--skipUserCfg",
    "--skipParentCfg",
    "--skipProjCfg",
    "--hints:off",
    "--warnings:off",
    "--colors:off",
)
#: Its compiler makes C, which the C compiler compiles.
NIM = Language("Nim", "NIM", "nim", "nim (Debian and Ubuntu: apt-get install nim)", _NIM_FLAGS)


def toolchain_of_backend(backend: str) -> str:
    """Versions and flags of its compilers, as included in build_hash. Raises ToolchainError."""
    return f"{toolchain(NIM)}; {toolchain()}" if backend == "nim" else toolchain()
