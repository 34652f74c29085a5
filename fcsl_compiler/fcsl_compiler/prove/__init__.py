# SPDX-License-Identifier: Apache-2.0
"""Proofs about a whole machine: its tick as terms of an SMT solver."""
