// Pinocchio's own algorithms, templates compiled here.
#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/crba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio_arm.hpp"

using Map = Eigen::Map<const Eigen::Matrix<double, 6, 1>>;

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  pinocchio::Model model = pinocchio_model(arm);
  pinocchio::Data data(model);
  Eigen::VectorXd q(6), v(6), a(6), tau(6);
  auto load = [&](const State& s) { q = Map(s.q), v = Map(s.qd), a = Map(s.qdd), tau = Map(s.tau); };
  time_calls("pinocchio.inverse", arm, [&](const State& s) { load(s), keep(&pinocchio::rnea(model, data, q, v, a)); });
  time_calls("pinocchio.mass_matrix", arm, [&](const State& s) { load(s), keep(&pinocchio::crba(model, data, q)); });
  time_calls("pinocchio.forward", arm, [&](const State& s) { load(s), keep(&pinocchio::aba(model, data, q, v, tau)); });
}
