# SPDX-License-Identifier: Apache-2.0
"""Design work on a plant: its linearisation, and its equilibria (docs/guide/campaigns.md)."""
