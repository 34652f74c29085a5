# SPDX-License-Identifier: Apache-2.0
"""JSON files as text with places, readers that report what is wrong in them, paths that they give."""

from ..parse.constants import read_constants
from ..parse.csv_column import read_column
from ..parse.json_reader import ConfigReader, Everything
from ..parse.json_source import JsonNode, Member, parse_json
from ..parse.source_path import SourcePathError, resolve_source

__all__ = [
    "ConfigReader",
    "Everything",
    "JsonNode",
    "Member",
    "SourcePathError",
    "parse_json",
    "read_column",
    "read_constants",
    "resolve_source",
]
