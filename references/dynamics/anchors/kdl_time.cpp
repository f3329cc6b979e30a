// Orocos KDL.
#include <kdl/chain.hpp>
#include <kdl/chaindynparam.hpp>
#include <kdl/chainidsolver_recursive_newton_euler.hpp>

#include "arm.hpp"

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  KDL::Chain chain;
  KDL::Vector gravity(arm.gravity[0], arm.gravity[1], arm.gravity[2]);
  for (int k = 0; k < 6; ++k) {
    // A KDL segment turns first and then goes to its tip, so each joint origin closes the segment before it.
    auto frame = [](const Origin& o) {
      return KDL::Frame(KDL::Rotation::RPY(o.rpy[0], o.rpy[1], o.rpy[2]), KDL::Vector(o.xyz[0], o.xyz[1], o.xyz[2]));
    };
    if (k == 0) chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::None), frame(arm.joints[0])));
    const Link& l = arm.links[k + 1];
    const double* i = l.inertia;
    KDL::RigidBodyInertia about_com(l.mass, KDL::Vector::Zero(),
                                    KDL::RotationalInertia(i[0], i[3], i[5], i[1], i[2], i[4]));
    KDL::Frame tip = frame(arm.joints[k + 1]);
    chain.addSegment(KDL::Segment(KDL::Joint(KDL::Joint::RotZ), tip, frame(l.origin) * about_com));
  }
  KDL::ChainIdSolver_RNE inverse(chain, gravity);
  KDL::ChainDynParam dynamics(chain, gravity);
  KDL::JntArray q(6), v(6), a(6), tau(6);
  KDL::JntSpaceInertiaMatrix mass(6);
  KDL::Wrenches none(chain.getNrOfSegments(), KDL::Wrench::Zero());
  auto load = [&](const State& s) {
    for (int k = 0; k < 6; ++k) q(k) = s.q[k], v(k) = s.qd[k], a(k) = s.qdd[k];
  };
  time_calls("kdl.inverse", arm, [&](const State& s) { load(s), inverse.CartToJnt(q, v, a, none, tau), keep(&tau); });
  time_calls("kdl.mass_matrix", arm, [&](const State& s) { load(s), dynamics.JntToMass(q, mass), keep(&mass); });
}
