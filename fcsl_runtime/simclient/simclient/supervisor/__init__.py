# SPDX-License-Identifier: Apache-2.0
"""The supervisor: starts, stops and shows flights and simulations of this machine over HTTP (docs/supervisor.md).

`limits` bounds everything; `files` and `options` check what a request may name; `child`, `runs` start and end programs; `run_status`,
`metrics`, `windows`, `page` show them; `guard` and `timeouts` keep strangers and slow clients out; `request_parameters`, `app` and
`service` are the HTTP side.
"""
