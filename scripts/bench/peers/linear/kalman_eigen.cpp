/* SPDX-License-Identifier: Apache-2.0
 *
 * The Kalman filter with Eigen: fixed sizes, no allocation, no temporary that `noalias` can save. `lazyProduct`, since beyond
 * 8 × 8 `*` is a product in blocks for large matrices, and slower here; row-major, which was the faster storage.
 */
#include "kernel.h"
#include "model.h" /* N and the matrices, row-major */

#include <Eigen/Dense>

namespace
{

template <int Rows, int Columns>
using Matrix = Eigen::Matrix<double, Rows, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

struct Filter {
    Matrix<N, N> f, q, p;
    Matrix<3, N> h;
    Matrix<3, 3> r;
    Matrix<N, 1> x;

    void step(const Matrix<3, 1> &z)
    {
        x = f * x;
        Matrix<N, N> fp;
        fp.noalias() = f.lazyProduct(p);
        p.noalias() = fp.lazyProduct(f.transpose());
        p += q;
        Matrix<N, 3> pht;
        pht.noalias() = p.lazyProduct(h.transpose());
        Matrix<3, N> hp;
        hp.noalias() = h.lazyProduct(p);
        Matrix<3, 3> s;
        s.noalias() = hp.lazyProduct(h.transpose());
        s += r;
        Matrix<N, 3> k;
        k.noalias() = pht.lazyProduct(s.inverse());
        Matrix<3, 1> innovation = z;
        innovation.noalias() -= h.lazyProduct(x);
        x.noalias() += k.lazyProduct(innovation);
        p.noalias() -= k.lazyProduct(hp);
    }
};

Filter filter;

} // namespace

void kernel_reset(void)
{
    filter.f = Eigen::Map<const Matrix<N, N>>(model_f);
    filter.h = Eigen::Map<const Matrix<3, N>>(model_h);
    filter.q = Eigen::Map<const Matrix<N, N>>(model_q);
    filter.r = Eigen::Map<const Matrix<3, 3>>(model_r);
    filter.x.setZero();
    filter.p.setZero();
}

void kernel_run(const double *inputs, long steps)
{
    for (long k = 0; k < steps; ++k) {
        filter.step(Eigen::Map<const Matrix<3, 1>>(inputs + 3 * k));
    }
}

void kernel_result(double *result)
{
    Eigen::Map<Matrix<N, 1>> x(result);
    x = filter.x;
    Eigen::Map<Matrix<N, N>> p(result + N);
    p = filter.p;
}
