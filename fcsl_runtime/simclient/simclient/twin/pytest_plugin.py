# SPDX-License-Identifier: Apache-2.0
"""The pytest plugin of simclient: the fixtures `fcsl` and `fcsl_sim` (pytest_twins.py), tests of campaigns
(pytest_campaign.py), and --fcsl-cover, the coverage of algorithms.

pytest loads it automatically if simclient is in the environment (entry point pytest11 in setup.cfg); elsewhere use
`-p simclient.twin.pytest_plugin`. Nothing is imported unless a test or an option needs it.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from .pytest_campaign import _fcsl_studies as _fcsl_studies
from .pytest_campaign import add_mark as add_campaign_mark
from .pytest_campaign import fcsl_case as fcsl_case
from .pytest_campaign import generate
from .pytest_requirements import WorkerNodes, add_option, configure
from .pytest_requirements import pytest_runtest_call as pytest_runtest_call
from .pytest_requirements import pytest_runtest_teardown as pytest_runtest_teardown
from .pytest_requirements import pytest_sessionfinish as pytest_sessionfinish
from .pytest_twins import add_options
from .pytest_twins import fcsl as fcsl
from .pytest_twins import fcsl_sim as fcsl_sim
from .pytest_twins import pytest_runtest_makereport as pytest_runtest_makereport

if TYPE_CHECKING:
    from fcsl_compiler.api.coverage import Report


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("fcsl", "FCSL machines")
    add_options(group)
    add_option(group)
    group.addoption(
        "--fcsl-cover",
        nargs="?",
        action="append",
        const="",
        default=[],
        metavar="MACHINE.json",
        help="report which lines, branches and conditions of the algorithms the tests reach: for every machine that runs, or "
        "for those named (--fcsl-cover=MACHINE.json, once for each); as `fcsl cover` does",
    )
    group.addoption("--fcsl-cover-json", metavar="FILE", help="also write the report of --fcsl-cover to this JSON file")
    group.addoption(
        "--fcsl-cover-fail-under",
        action="append",
        default=[],
        metavar="KIND=PERCENT",
        help="fail if a machine has less; KIND is line, branch or mcdc; may be given for each",
    )


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    generate(metafunc)


def pytest_configure(config: pytest.Config) -> None:
    add_campaign_mark(config)
    configure(config)
    config.pluginmanager.register(WorkerNodes(), "fcsl_requirements")
    for option in ("--fcsl-cover-json", "--fcsl-cover-fail-under"):
        if config.getoption(option) and not config.getoption("--fcsl-cover"):
            raise pytest.UsageError(f"{option} does nothing without --fcsl-cover; add it")
    # A pytest-xdist worker counts into its master's folder, and the master reports.
    if config.getoption("--fcsl-cover") and not hasattr(config, "workerinput"):
        config.pluginmanager.register(_Coverage(config), "fcsl_coverage")


class _Coverage:
    """Measures coverage from start to end of the session, in this process and its child processes."""

    def __init__(self, config: pytest.Config):
        from fcsl_compiler.api.coverage import COVER_DIR, CoverError, parse_limits, refuse_foreign

        try:
            self._limits = parse_limits(config.getoption("--fcsl-cover-fail-under"))
        except CoverError as error:
            raise pytest.UsageError(f"--fcsl-cover-fail-under: {error}") from None
        named = [Path(name) for name in config.getoption("--fcsl-cover") if name]
        self._configs = [path if path.is_absolute() else config.invocation_params.dir / path for path in named]
        for path, name in zip(self._configs, named, strict=True):
            if path.suffix != ".json" or not path.is_file():
                fix = "write --fcsl-cover=MACHINE.json, or --fcsl-cover behind the tests' paths for every machine"
                raise pytest.UsageError(f"--fcsl-cover: `{name}` is not a machine's JSON file; {fix}")
        json_file = config.getoption("--fcsl-cover-json")
        self._json = config.invocation_params.dir / json_file if json_file else None
        if self._json is not None:
            try:
                refuse_foreign(self._json)
            except CoverError as error:
                raise pytest.UsageError(f"--fcsl-cover-json: {error}") from None
        self._report: Report | None = None
        self._failures: list[str] = []
        # If `fcsl cover` measures this session as well, both use one folder.
        self._own = None if os.environ.get(COVER_DIR) else tempfile.TemporaryDirectory(prefix="fcsl-cover-")
        if self._own is not None:
            os.environ[COVER_DIR] = self._own.name
        self._folder = Path(os.environ[COVER_DIR])

    def pytest_sessionfinish(self, session: pytest.Session) -> None:
        from fcsl_compiler.api.coverage import CoverError, make_report
        from fcsl_compiler.api.files import write_whole

        try:
            self._report = make_report(self._folder, self._configs)
            self._failures = self._report.below(self._limits)
            if self._report.absent and not self._limits:
                self._failures = [f"{path}: no test ran this machine" for path in self._report.absent]
            if self._json is not None:
                write_whole(self._json, self._report.to_json())
        except CoverError as error:
            self._failures = [str(error)]
        except OSError as error:
            self._failures = [f"{error.filename or ''}: {error.strerror}"]
        if self._failures and session.exitstatus == pytest.ExitCode.OK:
            session.exitstatus = pytest.ExitCode.TESTS_FAILED

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        terminalreporter.section("coverage of algorithms")
        if self._report is not None:
            terminalreporter.write(self._report.text())
        for failure in self._failures:
            terminalreporter.write_line(f"--fcsl-cover: {failure}", red=True)

    def pytest_unconfigure(self) -> None:
        from fcsl_compiler.api.coverage import COVER_DIR

        if self._own is not None:
            os.environ.pop(COVER_DIR, None)
            self._own.cleanup()
