# SPDX-License-Identifier: Apache-2.0
"""The results of a campaign: a file with a place for each case, which survives a kill, and the table that is made of it.

Both are the same whatever the order in which cases were flown, and by how many processes.
"""

from __future__ import annotations

import json
import os
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fcsl_compiler.base.json_file import read_json

from ..errors import SimError
from .flight import Outcome
from .study import Study

#: In the folder of a campaign.
ABOUT, PLACES, TABLE, PICTURE = "campaign.json", "cases.bin", "cases.parquet", "report.png"
#: By its number; 0: not flown yet.
_VERDICTS = ("", "passed", "failed", "error")
_ENDS = ("", "duration", "until", "error")
_ERROR_BYTES = 240
#: That are made to columns at a time, which bounds the memory.
_GROUP_ROWS = 1 << 12


class Results:
    """The folder of a campaign. `done` counts cases."""

    def __init__(self, study: Study, folder: Path, restart: bool = False):
        """Makes the folder, or goes on with it. restart: what it holds is removed. Raises SimError if it holds another
        campaign, or no campaign."""
        self.study, self.folder = study, folder
        about = {"study": study.path.name, "cases": study.cases, "fingerprint": study.fingerprint}
        if restart and (folder / ABOUT).is_file():
            shutil.rmtree(folder)
        self._refuse_others(about)
        folder.mkdir(parents=True, exist_ok=True)
        kind = [("verdict", "u1"), ("end", "u1"), ("ticks", "<u8"), ("hash", "S16"), ("error", f"S{_ERROR_BYTES}")]
        self._dtype = np.dtype([*kind, ("metrics", "<f8", (len(study.metrics),))])
        places = folder / PLACES
        if not (folder / ABOUT).is_file():
            with places.open("wb") as stream:
                stream.truncate(study.cases * self._dtype.itemsize)
            _replace(folder / ABOUT, json.dumps(about, indent=2) + "\n")
        self._places: Any = np.memmap(places, self._dtype, "r+", shape=(study.cases,))
        self.done = int(np.count_nonzero(self._places["verdict"]))

    def _refuse_others(self, about: dict[str, Any]) -> None:
        folder = self.folder
        if not folder.exists():
            return
        file = folder / ABOUT
        if not folder.is_dir() or (any(folder.iterdir()) and not file.is_file()):
            raise SimError(f"{folder}: there already, and no campaign's folder; choose another one with `-o`")
        if not file.is_file():
            return
        try:
            found = read_json(file)
            size = (folder / PLACES).stat().st_size
        except (OSError, ValueError):
            found, size = None, 0
        if found != about or size == 0:
            raise SimError(
                f"{folder}: has results of another study, or of this one before it, its models or its machine changed; "
                "`--restart` removes them, `-o` chooses another folder"
            )

    def missing(self) -> Iterator[int]:
        """Cases that are not flown yet, in their order."""
        for first in range(0, self.study.cases, _GROUP_ROWS):
            for place in np.flatnonzero(self._places["verdict"][first : first + _GROUP_ROWS] == 0):
                yield first + int(place)

    def add(self, outcome: Outcome) -> None:
        place = self._places[outcome.case]
        if place["verdict"] == 0:
            self.done += 1
        place["end"], place["ticks"], place["hash"] = _ENDS.index(outcome.end), outcome.ticks, outcome.hash
        place["error"] = outcome.error.encode("utf-8", "replace")[:_ERROR_BYTES]
        place["metrics"][:] = outcome.metrics
        place["verdict"] = _VERDICTS.index(outcome.verdict)  # last: then the case is flown

    def count(self, verdict: str) -> int:
        return int(np.count_nonzero(self._places["verdict"] == _VERDICTS.index(verdict)))

    def outcome(self, case: int) -> Outcome:
        place = self._places[case]
        return Outcome(
            case,
            self.study.seed_of(case),
            self.study.values(case),
            _VERDICTS[place["verdict"]],
            _ENDS[place["end"]],
            int(place["ticks"]),
            bytes(place["hash"]).decode(),
            tuple(place["metrics"].tolist()),
            bytes(place["error"]).decode("utf-8", "replace"),
        )

    def metric(self, name: str) -> np.ndarray[Any, Any]:
        """Of all cases; NaN where a case has none."""
        index = list(self.study.metrics).index(name)
        values = np.array(self._places["metrics"][:, index])
        values[self._places["verdict"] == 0] = np.nan
        return values

    def passed(self) -> np.ndarray[Any, Any]:
        """Whether each case has passed."""
        return np.array(self._places["verdict"] == _VERDICTS.index("passed"))

    def cases_of(self, verdict: str, at_most: int) -> list[int]:
        return [int(i) for i in np.flatnonzero(self._places["verdict"] == _VERDICTS.index(verdict))[:at_most]]

    def write_table(self) -> Path:
        """cases.parquet, a row for each case in their order. All cases must be flown."""
        import pyarrow as pa  # imported here, because it takes long to load
        import pyarrow.parquet as pq

        path = self.folder / TABLE
        temporary = path.with_suffix(".new")
        writer = None
        try:
            for first in range(0, self.study.cases, _GROUP_ROWS):
                table = pa.table(self._columns(range(first, min(first + _GROUP_ROWS, self.study.cases))))
                writer = writer or pq.ParquetWriter(temporary, table.schema, compression="zstd")
                writer.write_table(table)
        finally:
            if writer:
                writer.close()
        os.replace(temporary, path)
        return path

    def _columns(self, cases: range) -> dict[str, Any]:
        import pyarrow as pa

        places = self._places[cases.start : cases.stop]
        columns: dict[str, Any] = {
            "case": pa.array(cases, pa.int64()),
            "seed": pa.array([self.study.seed_of(case) for case in cases], pa.uint64()),
        }
        values = list(zip(*(self.study.values(case) for case in cases), strict=True))
        for dispersed, column in zip(self.study.parameters, values, strict=True):
            columns[dispersed.path] = pa.array(column)
        for index, name in enumerate(self.study.metrics):
            columns[name] = pa.array(np.ascontiguousarray(places["metrics"][:, index]))
        columns["verdict"] = pa.array([_VERDICTS[number] for number in places["verdict"]])
        columns["end"] = pa.array([_ENDS[number] for number in places["end"]])
        columns["ticks"] = pa.array(np.ascontiguousarray(places["ticks"]))
        columns["hash"] = pa.array([bytes(digest).decode() for digest in places["hash"]])
        columns["error"] = pa.array([bytes(text).decode("utf-8", "replace") for text in places["error"]])
        return columns


def _replace(path: Path, text: str) -> None:
    """Writes the whole file, or nothing."""
    temporary = path.with_suffix(".new")
    temporary.write_text(text)
    os.replace(temporary, path)
