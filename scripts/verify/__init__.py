# SPDX-License-Identifier: Apache-2.0
"""`make verify`: checks.py lists the checks. Each has a folder, whose main.py runs it; shared/ is for all of them."""
