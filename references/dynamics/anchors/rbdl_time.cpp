// RBDL.
#include <rbdl/rbdl.h>

#include "arm.hpp"

namespace rbd = RigidBodyDynamics;

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  rbd::Model model;
  model.gravity = rbd::Math::Vector3d(arm.gravity[0], arm.gravity[1], arm.gravity[2]);
  auto turn = [](const double* rpy) {
    auto m = rpy_matrix(rpy);
    rbd::Math::Matrix3d r;
    for (int i = 0; i < 9; ++i) r(i / 3, i % 3) = m[i];
    return r;
  };
  unsigned parent = 0;
  for (int k = 0; k < 6; ++k) {
    const Origin& o = arm.joints[k];
    const Link& l = arm.links[k + 1];
    const double* i = l.inertia;
    rbd::Math::Matrix3d j, r = turn(l.origin.rpy);
    j << i[0], i[1], i[2], i[1], i[3], i[4], i[2], i[4], i[5];
    rbd::Body body(l.mass, rbd::Math::Vector3d(l.origin.xyz[0], l.origin.xyz[1], l.origin.xyz[2]),
                   rbd::Math::Matrix3d(r * j * r.transpose()));
    rbd::Math::SpatialTransform place(turn(o.rpy).transpose(), rbd::Math::Vector3d(o.xyz[0], o.xyz[1], o.xyz[2]));
    parent = model.AddBody(parent, place, rbd::Joint(rbd::JointTypeRevoluteZ), body);
  }
  rbd::Math::VectorNd q(6), v(6), a(6), tau(6), out(6);
  auto load = [&](const State& s) {
    for (int k = 0; k < 6; ++k) q[k] = s.q[k], v[k] = s.qd[k], a[k] = s.qdd[k], tau[k] = s.tau[k];
  };
  time_calls("rbdl.inverse", arm, [&](const State& s) { load(s), rbd::InverseDynamics(model, q, v, a, out), keep(&out); });
  time_calls("rbdl.forward", arm, [&](const State& s) { load(s), rbd::ForwardDynamics(model, q, v, tau, out), keep(&out); });
}
