# SPDX-License-Identifier: Apache-2.0
"""trials.jsonl: the candidates that were flown, a line each, so that a search that is killed goes on.

The search is a function of the study alone: begun anew, it asks for the same candidates in the same order, and those in the file
are not flown again. Each line has a checksum of itself and of the study; a damaged or torn one counts as not there.
"""

from __future__ import annotations

import json
import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fcsl_compiler.api.files import SourceError, digest, open_regular

from ..errors import SimError
from .score import Score

LOG = "trials.jsonl"
Candidate = tuple[float, ...]


@dataclass(frozen=True)
class Trial:
    candidate: Candidate
    score: Score


class TrialLog:
    """`trials` by candidate. `damaged`: lines that count as not there."""

    def __init__(self, folder: Path, fingerprint: str, restart: bool):
        """Makes the folder, or goes on with it. restart: the trials that it holds are removed. Raises SimError if it holds those of
        another search, or something else."""
        self.path = folder / LOG
        self._fingerprint = fingerprint
        self.trials: dict[Candidate, Trial] = {}
        self.damaged = 0
        if folder.exists() and not self.path.is_file() and (not folder.is_dir() or any(folder.iterdir())):
            raise SimError(f"{folder}: there already, and no folder of `fcsl tune`; choose another one with `-o`")
        folder.mkdir(parents=True, exist_ok=True)
        if restart:
            self.path.unlink(missing_ok=True)
        try:
            self._file = open_regular(str(self.path), os.O_RDWR | os.O_CREAT | os.O_CLOEXEC)
            text = os.pread(self._file, os.fstat(self._file).st_size, 0).decode("utf-8", "replace")
        except SourceError as error:
            raise SimError(f"{self.path}: {error}") from None
        except OSError as error:
            raise SimError(f"{self.path}: {error.strerror}") from None
        self._read(text, folder)

    def _read(self, text: str, folder: Path) -> None:
        first, *lines = text.split("\n")
        head = self._line({"fingerprint": self._fingerprint})
        if text and first != head:
            raise SimError(
                f"{folder}: has trials of another study, or of this one before it, its models, its machine or FCSL changed; "
                "`--restart` removes them, `-o` chooses another folder"
            )
        self._at = os.lseek(self._file, 0, os.SEEK_END)
        if not text:
            self._append(head)
        elif not text.endswith("\n"):
            self._append("")  # behind a torn line
        for line in filter(None, lines):
            try:
                found = json.loads(line)
                row = {name: found[name] for name in ("candidate", "missed", "cost")}
            except (ValueError, TypeError, KeyError):
                self.damaged += 1
                continue
            if self._line(row) == line:
                candidate = tuple(row["candidate"])
                self.trials[candidate] = Trial(candidate, Score(row["missed"], row["cost"]))
            else:
                self.damaged += 1

    def add(self, candidate: Sequence[float], score: Score) -> Trial:
        trial = Trial(tuple(candidate), score)
        row = {"candidate": list(trial.candidate), "missed": score.missed, "cost": score.cost}
        self._append(self._line(row))
        self.trials[trial.candidate] = trial
        return trial

    def close(self) -> None:
        os.close(self._file)

    def _line(self, row: dict[str, Any]) -> str:
        return json.dumps(row | {"check": digest(self._fingerprint, json.dumps(row))})

    def _append(self, line: str) -> None:
        data = f"{line}\n".encode()
        try:
            if os.pwrite(self._file, data, self._at) != len(data):
                raise OSError(0, "the disk has taken a part of a line")
        except OSError as error:
            why = error.strerror or error
            raise SimError(
                f"{self.path}: {why}; trials that are flown are kept, and the same command goes on"
            ) from None
        self._at += len(data)
