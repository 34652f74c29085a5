# SPDX-License-Identifier: Apache-2.0
"""The names of the FCSL language, for editors and type checkers (see __init__.pyi); fcslc knows them by itself."""


def __getattr__(name: str) -> object:
    """An algorithm that somebody runs as a Python script ends here, with a reason. Raises ImportError."""
    if name.startswith("_"):
        raise AttributeError(name)
    raise ImportError(f"`{name}`: an algorithm is compiled by fcslc, not run by Python; test it with AlgTwin")
