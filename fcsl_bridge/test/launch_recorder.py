# SPDX-License-Identifier: Apache-2.0
"""Runs in place of a node that the real `launch` starts (its argument `launch-prefix`), and records what the node got.

    launch_recorder.py FOLDER CONTROLLER_NODE --ros-args ...

FOLDER has `behaviour.json`: for `<namespace>/<executable>` its exit status, and the seconds until it ends. The file
`<pid>.json` that this writes there has the command, the texts of its parameter files, the network settings, and at the
end whether it was interrupted.
"""

import json
import os
import signal
import sys
from pathlib import Path

folder, command = Path(sys.argv[1]), sys.argv[2:]
space = next((word.removeprefix("__ns:=").strip("/") for word in command if word.startswith("__ns:=")), "")
name = f"{space}/{Path(command[0]).name}"
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
status, seconds = json.loads((folder / "behaviour.json").read_text()).get(name, (0, 0.0))
files = [Path(after) for word, after in zip(command, command[1:], strict=False) if word == "--params-file"]
found = {
    "name": name,
    "command": command,
    "parameters": [file.read_text() for file in files],
    "environment": {key: value for key, value in os.environ.items() if "FASTRTPS" in key or "DISCOVERY" in key},
    "interrupted": bool(signal.sigtimedwait([signal.SIGINT], seconds)) if seconds else False,
}
(folder / f"{os.getpid()}.json").write_text(json.dumps(found))
sys.exit(status)
