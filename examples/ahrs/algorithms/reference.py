"""An attitude from elsewhere to compare with, such as the one a robot recorded: a source block, written by the host."""


class Outputs:
    orientation: "f64[4]"  # unit quaternion w, x, y, z, body to world; zero while there is none


def execute() -> None:
    pass
