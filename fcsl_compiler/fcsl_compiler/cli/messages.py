# SPDX-License-Identifier: Apache-2.0
"""`fcsl messages`: writes the ROS 2 messages of machines."""

from __future__ import annotations

import argparse

from ..base.files import write_whole
from ..base.usage_error import UsageError
from ..driver.passes import compile_machine
from ..emit.messages import message_texts
from .build import compiler_files, machine_files, refuse_file


def run(options: argparse.Namespace) -> int:
    """Writes changed messages and lists all. Each message belongs to one machine."""
    refuse_file(options.output)
    texts: dict[str, str] = {}
    read = compiler_files()
    for path in options.config:
        compilation = compile_machine(path, "", until="schedule")
        read += machine_files(compilation)
        m = compilation.checked
        if options.package not in (None, m.package):
            raise UsageError(
                f"`{path}` is in package `{m.package}` (the nearest package.xml above it), so that package "
                f"`{options.package}` cannot build its messages; move the machine there, or build them in `{m.package}`"
            )
        own = message_texts(m)
        if twice := sorted(texts.keys() & own.keys()):
            raise UsageError(
                f"`{path}`: message `{twice[0]}` also belongs to another machine; rename one of the instances"
            )
        texts |= own
    for name, text in texts.items():
        file = options.output / f"{name}.msg"
        write_whole(file, text)
        print(file)
    if options.sources:
        write_whole(options.sources, "".join(f"{file}\n" for file in read))
    return 0
