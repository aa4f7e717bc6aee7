/* Derivatives of forward dynamics by Pinocchio (Carpentier and Mansard 2018), for derivative_peers.py. */
#include <pinocchio/fwd.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/algorithm/aba-derivatives.hpp>

using namespace pinocchio;

struct Mechanism {
    Model model;
    Data *data;
};

/* Of each joint: its kind, of which 0 to 2 turn about x to z and 3 is free; its parent; its place there, a rotation row
   by row and a translation; mass, centre and inertia of what it moves, row by row. */
extern "C" void *mechanism(int count, const double *joints) {
    Mechanism *m = new Mechanism;
    for (int i = 0; i < count; i++, joints += 27) {
        typedef Eigen::Matrix<double, 3, 3, Eigen::RowMajor> Rows;
        const SE3 place(Eigen::Map<const Rows>(joints + 2), Eigen::Map<const Eigen::Vector3d>(joints + 11));
        const JointIndex parent = (JointIndex)joints[1];
        const std::string name = "j" + std::to_string(i);
        const int kind = (int)joints[0];
        const JointIndex at = kind == 0   ? m->model.addJoint(parent, JointModelRX(), place, name)
                              : kind == 1 ? m->model.addJoint(parent, JointModelRY(), place, name)
                              : kind == 2 ? m->model.addJoint(parent, JointModelRZ(), place, name)
                                          : m->model.addJoint(parent, JointModelFreeFlyer(), place, name);
        const Inertia inertia(joints[14], Eigen::Map<const Eigen::Vector3d>(joints + 15), Eigen::Map<const Rows>(joints + 18));
        m->model.appendBodyToJoint(at, inertia, SE3::Identity());
    }
    m->data = new Data(m->model);
    return m;
}

/* Of `count` states, a row of q, v and tau each: by q and by v, each a matrix column by column. */
extern "C" void each(Mechanism *m, long count, const double *q, const double *v, const double *tau, double *out) {
    const int n = m->model.nv, nq = m->model.nq;
    Eigen::VectorXd a(nq), b(n), c(n);
    for (long i = 0; i < count; i++) {
        a = Eigen::Map<const Eigen::VectorXd>(q + i * nq, nq), b = Eigen::Map<const Eigen::VectorXd>(v + i * n, n);
        c = Eigen::Map<const Eigen::VectorXd>(tau + i * n, n);
        computeABADerivatives(m->model, *m->data, a, b, c);
        Eigen::Map<Eigen::MatrixXd>(out, n, n) = m->data->ddq_dq;
        Eigen::Map<Eigen::MatrixXd>(out + n * n, n, n) = m->data->ddq_dv;
    }
}
