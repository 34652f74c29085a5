# SPDX-License-Identifier: Apache-2.0
"""The results of a campaign: a row for each case, which survives a kill, and the table that is made of them.

Both are the same whatever the order in which cases were flown, and by how many processes.
"""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.api.files import digest, read_json

from ..errors import SimError
from .case_rows import GROUP_ROWS, TEXT_BYTES, CaseRows, temporary_of, written_whole
from .flight import Outcome
from .study import Study

#: In the folder of a campaign.
ABOUT, ROWS, TABLE, REPORT = "campaign.json", "cases.bin", "cases.parquet", "report.html"
#: All that a campaign leaves which is killed when it begins.
_UNFINISHED = temporary_of(Path(ABOUT)).name
#: Of the rows; another one cannot be read.
_FORMAT = 2
#: By its number; 0: not flown yet.
_VERDICTS = ("", "passed", "failed", "error")
_ENDS = ("", "duration", "until", "error")
#: Of damaged cases that a message names.
_NAMED = 5


class Results:
    """The folder of a campaign. `done` counts cases; `damage` says what was damaged in the folder, a line each: these cases count
    as not flown."""

    def __init__(self, study: Study, folder: Path, restart: bool = False):
        """Makes the folder, or goes on with it. restart: the results that it holds are removed. Raises SimError if it holds
        another campaign, or no campaign."""
        self.study, self.folder = study, folder
        self.damage: list[str] = []
        about = {"format": _FORMAT, "study": study.path.name, "cases": study.cases, "fingerprint": study.fingerprint}
        if restart and (folder / ABOUT).is_file():
            for name in (ROWS, TABLE, REPORT, ABOUT):
                (folder / name).unlink(missing_ok=True)
        there = self._check(about)
        if there is False:
            folder.mkdir(parents=True, exist_ok=True)
            self._write_about(about)
        self._rows = CaseRows(folder / ROWS, study.cases, len(study.columns), study.fingerprint)
        self._verdicts = self._check_rows()
        self.done = int(np.count_nonzero(self._verdicts))
        if there is None:
            self._restore_about(about)
        if there and self._rows.size != self._rows.bytes:
            self.damage.append(f"{self._rows.path}: has {self._rows.size} bytes, not {self._rows.bytes}")
        self._rows.reserve()

    def _check(self, about: dict[str, Any]) -> bool | None:
        """Whether the folder has results of this campaign; None: its campaign.json is damaged, so only the rows can tell."""
        folder, file = self.folder, self.folder / ABOUT
        if not folder.exists():
            return False
        if folder.is_dir() and not file.is_file() and {other.name for other in folder.iterdir()} <= {_UNFINISHED}:
            return False
        if not file.is_file():
            raise SimError(f"{folder}: there already, and no campaign's folder; choose another one with `-o`")
        try:
            found = read_json(file)
        except ValueError:
            return None
        is_flat = isinstance(found, dict) and all(isinstance(value, str | int) for value in found.values())
        if not is_flat or found.pop("check", None) != digest(json.dumps(found)):
            return None
        if found != about:
            raise SimError(
                f"{folder}: has results of another study, or of this one before it, its models, its machine or FCSL "
                "changed; `--restart` removes them, `-o` chooses another folder"
            )
        return True

    def _write_about(self, about: dict[str, Any]) -> None:
        with written_whole(self.folder / ABOUT) as path:
            path.write_text(json.dumps(about | {"check": digest(json.dumps(about))}, indent=2) + "\n")

    def _restore_about(self, about: dict[str, Any]) -> None:
        """Rows with right checksums are of this campaign."""
        file = self.folder / ABOUT
        if not self.done:
            raise SimError(
                f"{file}: is damaged, or another version of FCSL wrote it, and no case in the folder is of this study; "
                "`--restart` removes the results, `-o` chooses another folder"
            )
        self._write_about(about)
        self.damage.append(f"{file}: was damaged, and is written anew")

    def _check_rows(self) -> np.ndarray[Any, np.dtype[np.uint8]]:
        """The verdicts of all rows, 0 for a damaged one."""
        verdicts = np.zeros(self.study.cases, np.uint8)
        wrong: list[int] = []
        for first, rows in self._rows.groups():
            verdicts[first : first + len(rows)] = rows["verdict"]
            wrong += [case for case, row in enumerate(rows, first) if not self._rows.is_right(case, row)]
        verdicts[wrong] = 0
        if wrong:
            more = f" and {len(wrong) - _NAMED} more" if len(wrong) > _NAMED else ""
            named = ", ".join(map(str, wrong[:_NAMED])) + more
            self.damage.append(f"{self._rows.path}: damaged, so flown again: case {named}")
        return verdicts

    def missing(self) -> Iterator[int]:
        """Cases that are not flown yet, in their order."""
        for first in range(0, self.study.cases, GROUP_ROWS):
            for place in np.flatnonzero(self._verdicts[first : first + GROUP_ROWS] == 0):
                yield first + int(place)

    def add(self, outcome: Outcome) -> None:
        verdict = _VERDICTS.index(outcome.verdict)
        self._rows.write(
            outcome.case,
            verdict=verdict,
            end=_ENDS.index(outcome.end),
            ticks=outcome.ticks,
            hash=outcome.hash,
            text=(outcome.error or outcome.failed_by).encode("utf-8", "replace")[:TEXT_BYTES],
            metrics=outcome.metrics,
        )
        self.done += self._verdicts[outcome.case] == 0
        self._verdicts[outcome.case] = verdict

    def count(self, verdict: str) -> int:
        return int(np.count_nonzero(self._verdicts == _VERDICTS.index(verdict)))

    def outcome(self, case: int) -> Outcome:
        (row,) = self._rows.read(case, case + 1)
        verdict, text = _VERDICTS[row["verdict"]], bytes(row["text"]).decode("utf-8", "replace")
        return Outcome(
            case,
            self.study.seed_of(case),
            self.study.values(case),
            verdict,
            _ENDS[row["end"]],
            int(row["ticks"]),
            bytes(row["hash"]).decode(),
            tuple(row["metrics"].tolist()),
            error=text if verdict == "error" else "",
            failed_by=text if verdict == "failed" else "",
        )

    def metric(self, name: str) -> np.ndarray[Any, Any]:
        """A column of the study over all cases. All must be flown."""
        index = self.study.columns.index(name)
        return np.concatenate([np.array(rows["metrics"][:, index]) for _, rows in self._rows.groups()])

    def of(self, verdict: str) -> np.ndarray[Any, Any]:
        """Whether each case has this verdict."""
        return np.asarray(self._verdicts == _VERDICTS.index(verdict))

    def cases_of(self, verdict: str, at_most: int) -> list[int]:
        return [int(i) for i in np.flatnonzero(self._verdicts == _VERDICTS.index(verdict))[:at_most]]

    def write_table(self) -> Path:
        """cases.parquet, a row for each case in their order. All cases must be flown."""
        import pyarrow as pa  # imported here, because it takes long to load
        import pyarrow.parquet as pq

        path = self.folder / TABLE
        with written_whole(path) as temporary, temporary.open("wb") as stream:
            writer = None
            for first, rows in self._rows.groups():
                table = pa.table(self._columns(first, rows))
                writer = writer or pq.ParquetWriter(stream, table.schema, compression="zstd")
                writer.write_table(table)
            if writer:
                writer.close()
        return path

    def _columns(self, first: int, rows: np.ndarray[Any, Any]) -> dict[str, Any]:
        import pyarrow as pa

        cases = range(first, first + len(rows))
        columns: dict[str, Any] = {
            "case": pa.array(cases, pa.int64()),
            "seed": pa.array([self.study.seed_of(case) for case in cases], pa.uint64()),
        }
        values = list(zip(*(self.study.values(case) for case in cases), strict=True))
        for dispersed, column in zip(self.study.parameters, values, strict=True):
            columns[dispersed.path] = pa.array(column)
        for index, name in enumerate(self.study.columns):
            columns[name] = pa.array(np.ascontiguousarray(rows["metrics"][:, index]))
        verdicts = [_VERDICTS[number] for number in rows["verdict"]]
        texts = [bytes(text).decode("utf-8", "replace") for text in rows["text"]]
        columns["verdict"] = pa.array(verdicts)
        columns["end"] = pa.array([_ENDS[number] for number in rows["end"]])
        columns["ticks"] = pa.array(np.ascontiguousarray(rows["ticks"]))
        columns["hash"] = pa.array([bytes(digest).decode() for digest in rows["hash"]])
        for name, verdict in (("error", "error"), ("failed_by", "failed")):
            shown = [text if of == verdict else "" for text, of in zip(texts, verdicts, strict=True)]
            columns[name] = pa.array(shown)
        return columns
