# SPDX-License-Identifier: Apache-2.0
"""fcslc: compiles a machine (one JSON file and its algorithms) to self-contained C11."""
