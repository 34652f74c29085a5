# SPDX-License-Identifier: Apache-2.0
"""Printers: the text of code (model/code.py) in one language each.

A printer for another language is a folder beside these: its Expressions, Statements and Writer, and the spellings of
the op table.
"""
