"""Its outputs are written by the host."""


class Outputs:
    targets: "Target[2, 2]"  # row-major in the message
    pose: "Pose"
    alive: "bool"


def execute() -> None:
    pass
