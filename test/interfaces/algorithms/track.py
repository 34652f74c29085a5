class Track:
    """Its outputs are written by the host."""

    outputs = {
        "targets": "Target[2][2]",  # row-major in the message
        "pose": "Pose",
        "alive": "bool",
    }

    def execute(self):
        pass
