# SPDX-License-Identifier: Apache-2.0
"""The supervisor: starts, stops and shows flights and simulations of this machine over HTTP (docs/supervisor.md).

`limits` bounds everything; `files` and `options` check what a request may name; `child`, `runs` start and end programs; `look`,
`metrics`, `windows`, `page` show them; `guard` and `patience` keep strangers and slow clients out; `asked`, `app` and
`service` are the HTTP side.
"""
