from fcsl_builtins import cholesky, inv, matmul, quat_mul, quat_normalize, quat_rotate, solve, transpose


class Matrices:
    """A filter and a solver: long sums of products, in which a fused or reordered operation shows."""

    inputs = {"a": "f64[4][4]", "b": "f64[4]", "q": "f64[4]", "v": "f64[3]"}
    outputs = {"x": "f64[4]", "inverse": "f64[4][4]", "root": "f64[4][4]", "turned": "f64[3]"}
    state = {"turn": "f64[4]", "p": "f64[4][4]"}

    def start(self):
        self.turn = [1.0, 0.0, 0.0, 0.0]

    def execute(self):
        self.x = solve(self.a, self.b)
        self.inverse = inv(self.a)
        self.root = cholesky(matmul(self.a, transpose(self.a)))
        self.turn = quat_normalize(quat_mul(self.turn, self.q))
        self.turned = quat_rotate(self.turn, self.v)
        self.p = matmul(matmul(self.a, self.p), transpose(self.a)) * 0.0001 + self.a
