"""A filter and a solver: long sums of products, in which a fused or reordered operation shows."""

from fcsl_builtins import cholesky, f64, inv, matmul, quat_mul, quat_normalize, quat_rotate, solve, transpose


class Inputs:
    a: "f64[4, 4]"
    b: "f64[4]"
    q: "f64[4]"
    v: "f64[3]"


class Outputs:
    x: "f64[4]"
    inverse: "f64[4, 4]"
    root: "f64[4, 4]"
    turned: "f64[3]"


class State:
    q: "f64[4]"
    p: "f64[4, 4]"


def start(x: State) -> None:
    x.q = [1.0, 0.0, 0.0, 0.0]


def execute(u: Inputs, y: Outputs, x: State) -> None:
    y.x = solve(u.a, u.b)
    y.inverse = inv(u.a)
    y.root = cholesky(matmul(u.a, transpose(u.a)))
    x.q = quat_normalize(quat_mul(x.q, u.q))
    y.turned = quat_rotate(x.q, u.v)
    x.p = matmul(matmul(u.a, x.p), transpose(u.a)) * 0.0001 + u.a
