# SPDX-License-Identifier: Apache-2.0
"""The supervisor: starts, stops and shows flights and simulations on this computer over HTTP (docs/guide/monitoring.md).

`limits` defines all bounds. `files` and `options` check the files and options of a request. `child` and `runs` start
and end programs. `run_status`, `metrics`, `windows` and `page` show them. `guard` and `timeouts` reject unauthorized
and slow clients. `request_parameters`, `app` and `service` are the HTTP side.
"""
