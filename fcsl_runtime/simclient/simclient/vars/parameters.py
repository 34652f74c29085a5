# SPDX-License-Identifier: Apache-2.0
"""Commands of fcsl var about parameter files: save-parameters, load-parameters."""

from __future__ import annotations

import argparse
from pathlib import Path

from fcsl_compiler.api.files import SourceError, read_regular, write_whole

from .answers import open_client, print_answer, status_text, without_ok
from .wire import VarError

#: With quotes and escapes it fits a request (REQUEST_BYTES_MAX of limits.h).
_FILE_BYTES = 48 * 1024


def save(chosen: argparse.Namespace) -> None:
    path = Path(chosen.file)
    if path.exists() and not chosen.overwrite:
        raise VarError("bad_value", f"{path} exists; say --overwrite to replace it")
    with open_client(chosen) as client:
        text = client.parameters()
    try:
        write_whole(path, text)
    except OSError as error:
        raise VarError("bad_value", f"{path}: {error.strerror}") from None
    count = sum(line.startswith("    ") for line in text.splitlines())
    changed = f"{count} parameter{'s differ' if count != 1 else ' differs'} from the compiled values"
    print_answer(chosen, {"parameters": count}, lambda: f"{changed}: {path}")


def load(chosen: argparse.Namespace) -> None:
    try:
        text = read_regular(Path(chosen.file), _FILE_BYTES).decode()
    except (OSError, SourceError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else error
        raise VarError("bad_value", f"{chosen.file}: {reason}") from None
    with open_client(chosen, changes=True) as client:
        reply = client.set_parameters(text, str(chosen.file)[-120:])
    print_answer(chosen, without_ok(reply), lambda: status_text(reply))
