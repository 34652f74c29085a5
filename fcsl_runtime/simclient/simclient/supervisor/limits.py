# SPDX-License-Identifier: Apache-2.0
"""Every bound of the supervisor. Sizes in bytes, times in seconds."""

#: Runs that have ended and are still shown; of more the oldest are forgotten.
ENDED_RUNS = 16
#: What these keep of their telemetry, together: of more the oldest keep nothing.
ENDED_WINDOW_BYTES = 256 << 20

#: What is kept of what a run prints: its last lines, of so many bytes together; a longer line is cut.
LOG_BYTES, LOG_LINE_BYTES = 64 * 1024, 2048

BODY_BYTES = 64 * 1024
#: Lists and objects of a body inside each other.
BODY_DEPTH = 32
#: Of the line of a request and its headers.
HEAD_BYTES = 16 * 1024
#: Those beyond are answered that there are too many, and twice as many not at all.
CONNECTIONS = 64
#: From the connection until the head of its request, until the body of it, until the end of its response.
HEAD_S, BODY_S, CONNECTION_S = 10.0, 10.0, 60.0

#: How long a request waits for a run that it started to serve its variables.
START_S = 15.0
#: How long it waits for the first telemetry of a run that serves.
FIRST_TELEMETRY_S = 1.0
#: From SIGTERM to SIGKILL; a flight gives itself 3 s.
STOP_S = 6.0
#: From SIGKILL to where it is gone, at most: the kernel keeps one that waits for a device or a disk which does not answer.
KILL_S = 5.0
#: For a reply of a run's variable server.
LOOK_S = 2.0
#: From where a run's socket is gone to where the run is.
GONE_S = 1.0
#: A run that is not paused is stuck when its tick stands still between two looks that are so far apart, or two periods.
STUCK_S = 2.0

#: Of one window: scalars, over all paths and ticks.
WINDOW_VALUES = 1_000_000
#: Of one request for values or a window: as many as the variable server takes.
PATHS = 256
PATH_BYTES = 1024
#: Ticks that are kept of a run's telemetry, at most: where bodies are large, the receiver keeps fewer.
WINDOW_TICKS = 10_000
