# SPDX-License-Identifier: Apache-2.0
"""Diagnostics, and the places in source texts that they show."""

from ..base.diagnostics import Diagnostic, DiagnosticError, DiagnosticSink, Severity, longer_paths, nearest
from ..base.source import SourceFile, Span

__all__ = [
    "Diagnostic",
    "DiagnosticError",
    "DiagnosticSink",
    "Severity",
    "SourceFile",
    "Span",
    "longer_paths",
    "nearest",
]
