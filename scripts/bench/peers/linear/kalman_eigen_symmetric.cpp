/* SPDX-License-Identifier: Apache-2.0
 *
 * The Kalman filter with Eigen as kalman_eigen.cpp has it, but with what FCSL's functions make of symmetry: of products that are
 * symmetric the upper triangle is computed and mirrored, P H^T is read from H P, and S is solved with (Cholesky's factors)
 * instead of inverted.
 */
#include "kernel.h"
#include "model.h" /* N and the matrices, row-major */

#include <Eigen/Dense>

namespace
{

template <int Rows, int Columns>
using Matrix = Eigen::Matrix<double, Rows, Columns, Columns == 1 ? Eigen::ColMajor : Eigen::RowMajor>;

template <typename M> void mirror(M &m)
{
    m.template triangularView<Eigen::StrictlyLower>() = m.transpose();
}

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
        p.template triangularView<Eigen::Upper>() = fp.lazyProduct(f.transpose()) + q;
        mirror(p);
        Matrix<3, N> hp;
        hp.noalias() = h.lazyProduct(p);
        Matrix<3, 3> s;
        s.template triangularView<Eigen::Upper>() = hp.lazyProduct(h.transpose()) + r;
        mirror(s);
        const Matrix<3, N> kt = s.llt().solve(hp);
        Matrix<3, 1> innovation = z;
        innovation.noalias() -= h.lazyProduct(x);
        x.noalias() += kt.transpose().lazyProduct(innovation);
        p.template triangularView<Eigen::Upper>() -= kt.transpose().lazyProduct(hp);
        mirror(p);
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
