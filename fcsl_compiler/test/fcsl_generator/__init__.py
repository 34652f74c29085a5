# SPDX-License-Identifier: Apache-2.0
"""Well-typed algorithms and whole machines, made by Hypothesis, with a meaning of their own to compare with.

types        the types, and values of them
tree         programs as trees that carry the type of every expression, and their text
choices      what the generator asks Hypothesis
places       ways from the names in scope to a value of a type
expressions  an expression of any type
statements   function bodies
algorithms   whole algorithm files: classes, helpers and constants, and what one file imports from another
machines     machine JSON, and what a host does to it tick by tick
hardware     a board that tells calls of it by their order
externs      C functions that note their calls, and the same for the oracle
oracle       what a tree means, by Python integers and NumPy scalars; knows nothing of compiler and reference
ticks        what a machine means: the tick around the oracle
harness      compiles machines in batches, runs every implementation, compares, reports
"""
