class Reference:
    """An attitude from elsewhere to compare with, such as the one a robot recorded.

    A source block: the host writes its output.
    """

    outputs = {"orientation": "f64[4]"}  # unit quaternion w, x, y, z, body to world; zero while there is none

    def execute(self):
        pass
