# SPDX-License-Identifier: Apache-2.0
"""What the module level of an algorithm file declares, as data; collect.py fills it."""

from __future__ import annotations

import ast
from dataclasses import dataclass, field

from ..base.source import SourceFile, Span
from ..model import ir
from ..model.types import TypeNames
from .algorithm_class import AlgorithmClass
from .scope import Constant


@dataclass
class Declarations:
    """What one file declares, with the syntax trees of bodies still unchecked."""

    source: SourceFile
    owner: str  # of its functions and constants, in C
    names: TypeNames
    classes: dict[str, AlgorithmClass] = field(default_factory=dict)
    constants: dict[str, Constant] = field(default_factory=dict)
    functions: dict[str, ast.FunctionDef] = field(default_factory=dict)
    externs: dict[str, ir.Extern] = field(default_factory=dict)
    #: Helpers of other files, by the name they have here too.
    imported: dict[str, Declarations] = field(default_factory=dict)
    #: Where each name of the module is defined.
    defined: dict[str, Span] = field(default_factory=dict)
    #: Names of constants, functions and classes whose declaration was reported; their uses stay silent.
    wrong: set[str] = field(default_factory=set)
    declared: bool = True  # nothing of its classes and constants was reported
    sound: bool = True  # nor anything of its helpers and of the files it imports from
