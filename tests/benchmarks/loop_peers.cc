/* Planar mechanisms with one loop by Pinocchio's constraint dynamics (Carpentier, Budhiraja and Mansard 2021), for
   loop_peers.py. */
#include <pinocchio/fwd.hpp>
#include <pinocchio/multibody.hpp>
#include <pinocchio/constraints.hpp>
#include <pinocchio/algorithm/constrained-dynamics.hpp>

using namespace pinocchio;

struct Mechanism {
    Model model;
    Data *data;
    RigidConstraintModelVector loops;
    RigidConstraintDataVector made;
};

/* Of each body: whether it slides along x, or turns about z; its parent, from 1 on, and its place there; its mass, its
   centre of mass along x, and its moment of inertia. Of the loop: two bodies, each with the place of its pin along x. */
extern "C" void *mechanism(int count, const double *bodies, const double *loop) {
    Mechanism *m = new Mechanism;
    m->model.gravity.linear(Eigen::Vector3d(0, -9.81, 0));
    for (int i = 0; i < count; i++, bodies += 7) {
        SE3 place = SE3::Identity();
        place.translation() << bodies[2], bodies[3], 0;
        const JointIndex parent = (JointIndex)bodies[1];
        const JointIndex at = bodies[0] == 0 ? m->model.addJoint(parent, JointModelRZ(), place, "j" + std::to_string(i))
                                              : m->model.addJoint(parent, JointModelPX(), place, "j" + std::to_string(i));
        const Eigen::Matrix3d inertia = Eigen::Vector3d(bodies[6], bodies[6], bodies[6]).asDiagonal();
        m->model.appendBodyToJoint(at, Inertia(bodies[4], Eigen::Vector3d(bodies[5], 0, 0), inertia), SE3::Identity());
    }
    SE3 first = SE3::Identity(), second = SE3::Identity();
    first.translation() << loop[1], 0, 0;
    second.translation() << loop[3], 0, 0;
    m->loops.push_back(RigidConstraintModel(CONTACT_3D, m->model, (JointIndex)loop[0], first, (JointIndex)loop[2], second, LOCAL));
    m->made.push_back(m->loops[0].createData());
    m->data = new Data(m->model);
    initConstraintDynamics(m->model, *m->data, m->loops, m->made);
    return m;
}

/* The accelerations of `count` states, row by row, and the iterations in all. */
extern "C" void columns(Mechanism *m, long count, const double *q, const double *v, double *out, double mu, int most, long *iterations) {
    const int n = m->model.nv;
    ProximalSettings settings(1e-12, 1e-12, mu, most);
    const Eigen::VectorXd tau = Eigen::VectorXd::Zero(n);
    Eigen::VectorXd a(n), b(n);
    *iterations = 0;
    for (long i = 0; i < count; i++) {
        a = Eigen::Map<const Eigen::VectorXd>(q + i * n, n), b = Eigen::Map<const Eigen::VectorXd>(v + i * n, n);
        Eigen::Map<Eigen::VectorXd>(out + i * n, n) = constraintDynamics(m->model, *m->data, a, b, tau, m->loops, m->made, settings);
        *iterations += settings.iter;
    }
}
