# SPDX-License-Identifier: Apache-2.0
"""`fcsl interfaces`: stores the definitions of a machine's messages beside it, as they are installed."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from ..base.diagnostics import DiagnosticSink
from ..base.files import write_whole
from ..base.json_file import json_value
from ..parse.machine_files import parse_machine
from ..parse.machine_texts import message_types
from ..ros.interfaces import InterfaceError, installed_texts, stored_path, stored_text
from ..ros.standard_messages import full_name


def run(options: argparse.Namespace) -> int:
    config: Path = options.config
    sink = DiagnosticSink()
    parsed = parse_machine(config, sink)
    sink.raise_if_failed()
    assert parsed is not None
    path = stored_path(config)
    try:
        texts = installed_texts(map(full_name, message_types(json_value(parsed.source.text))))
    except InterfaceError as error:
        print(f"fcslc: error: {error.args[0]}; {error.args[1]}", file=sys.stderr)
        return 1
    if not texts:
        print(f"{config}: all its messages are standard; nothing to store")
        return 0
    write_whole(path, stored_text(texts))
    print(path)
    return 0
