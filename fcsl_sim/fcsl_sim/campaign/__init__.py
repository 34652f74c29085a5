# SPDX-License-Identifier: Apache-2.0
"""Campaigns: a simulation flown many times with dispersed parameters (docs/guide/campaigns.md)."""
