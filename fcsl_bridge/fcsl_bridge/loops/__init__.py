# SPDX-License-Identifier: Apache-2.0
"""A configured machine and what makes its ticks: a simulator, real time or /clock."""
