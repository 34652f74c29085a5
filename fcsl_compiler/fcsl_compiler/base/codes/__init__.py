# SPDX-License-Identifier: Apache-2.0
"""The diagnostic codes: what each means, why the rule exists, a wrong example and the right one."""
