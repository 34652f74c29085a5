# SPDX-License-Identifier: Apache-2.0
"""Libraries of machines and models: compilers, the cache, what a library was built of. Imports neither parser nor checker."""

from ..driver.cache import SHARED_RULES, BuiltMachine, build_machine, build_shared
from ..driver.cache_entry import cached
from ..driver.cache_folder import make_entry_folder
from ..driver.record import StaleBuild, check_record
from ..driver.symbols import SymbolError, check_model_symbols
from ..driver.toolchain import LANGUAGES, ToolchainError, cache_dir, include_dirs, math_library, toolchain, unwritten
from ..model.choices import BACKENDS, DEFAULT_BACKEND

__all__ = [
    "BACKENDS",
    "BuiltMachine",
    "DEFAULT_BACKEND",
    "LANGUAGES",
    "SHARED_RULES",
    "StaleBuild",
    "SymbolError",
    "ToolchainError",
    "build_machine",
    "build_shared",
    "cache_dir",
    "cached",
    "check_model_symbols",
    "check_record",
    "include_dirs",
    "make_entry_folder",
    "math_library",
    "toolchain",
    "unwritten",
]
