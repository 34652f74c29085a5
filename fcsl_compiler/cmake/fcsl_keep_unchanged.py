# SPDX-License-Identifier: Apache-2.0
"""`python3 fcsl_keep_unchanged.py GENERATOR [OPTIONS]` runs a generator of rosidl in a build by fcsl_generate_interfaces().

A generator writes the files of all messages anew when one message has changed, and all of them would be compiled again. Here a
file whose text is as before gets its time back. Ninja then compiles what has changed alone, and so does make; make would also
run the generator in each build to come, since its results stay older than the changed message: it returns at once unless
something that it reads has changed since.

Generators list what they include in the order of a set, which is another in each process unless the seed of hashes is given.
"""

from __future__ import annotations

import hashlib
import json
import os
import runpy
import sys
from pathlib import Path

ARGUMENTS = "--generator-arguments-file"


def inputs(arguments: dict[str, object]) -> set[Path]:
    """The files that the arguments of a generator name: as a path, as `name:path`, as `base:relative`, or, for the descriptions
    of packages, as `name:folder`."""
    named = set()
    for entries in arguments.values():
        for entry in entries if isinstance(entries, list) else []:
            name, _, rest = entry.rpartition(":")
            for path in (Path(entry), Path(rest), Path(name, rest)):
                named |= {path} if path.is_file() else set(path.rglob("*.json")) if rest and path.is_dir() else set()
    return named


def inputs_hash(options: list[str], arguments: dict[str, object]) -> str:
    """Of the options and of all that decides what the generator writes."""
    read = hashlib.sha256(json.dumps([options, arguments], sort_keys=True).encode())
    for path in sorted(inputs(arguments)):
        read.update(path.read_bytes())
    return read.hexdigest()


def files_in(folder: Path) -> list[Path]:
    return [path for path in folder.rglob("*") if path.is_file()]


def is_done(record: Path, key: str) -> bool:
    """The last call read the same, and what it left is still there. The record: the key, then a file a line."""
    if not record.is_file():
        return False
    known, *files = record.read_text(encoding="utf-8").split("\n")
    return known == key and all(Path(file).is_file() for file in files)


def main() -> None:
    if os.environ.get("PYTHONHASHSEED") != "0":
        os.execve(sys.executable, sys.orig_argv, {**os.environ, "PYTHONHASHSEED": "0"})
    generator, *options = sys.argv[1:]
    arguments_file = Path(options[options.index(ARGUMENTS) + 1])
    arguments = json.loads(arguments_file.read_text(encoding="utf-8"))
    folder = Path(arguments["output_dir"])
    record = arguments_file.with_suffix(".done")
    key = inputs_hash([generator, *options], arguments)
    if is_done(record, key):
        return
    record.unlink(missing_ok=True)
    before = {path: (path.stat().st_mtime_ns, path.read_bytes()) for path in files_in(folder)}
    sys.argv = [generator, *options]
    try:
        runpy.run_path(generator, run_name="__main__")
    except SystemExit as ended:
        if ended.code:
            raise
    for path, (time_ns, content) in before.items():
        if path.is_file() and path.read_bytes() == content:
            os.utime(path, ns=(time_ns, time_ns))
    record.write_text("\n".join([key, *map(str, files_in(folder))]), encoding="utf-8")


if __name__ == "__main__":
    main()
