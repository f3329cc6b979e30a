// Writes straight-line C for one arm: Pinocchio's algorithms run on CasADi's symbols.
#include <pinocchio/autodiff/casadi.hpp>

#include <pinocchio/algorithm/aba.hpp>
#include <pinocchio/algorithm/rnea.hpp>

#include "pinocchio_arm.hpp"

using Scalar = casadi::SX;
using Vector = Eigen::Matrix<Scalar, Eigen::Dynamic, 1>;

static Vector symbols(const Scalar& s) {
  Vector v(6);
  for (int i = 0; i < 6; ++i) v[i] = s(i);
  return v;
}

static Scalar column(const Vector& v) {
  Scalar s = Scalar::zeros(6);
  for (int i = 0; i < 6; ++i) s(i) = v[i];
  return s;
}

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  auto model = pinocchio_model(arm).cast<Scalar>();
  pinocchio::DataTpl<Scalar> data(model);
  Scalar q = Scalar::sym("q", 6), v = Scalar::sym("v", 6), a = Scalar::sym("a", 6);
  casadi::Function inverse(
      "inverse", {q, v, a}, {column(pinocchio::rnea(model, data, symbols(q), symbols(v), symbols(a)))});
  casadi::Function forward(
      "forward", {q, v, a}, {column(pinocchio::aba(model, data, symbols(q), symbols(v), symbols(a)))});
  casadi::CodeGenerator code("generated.c", {{"with_header", false}});
  code.add(inverse);
  code.add(forward);
  code.generate();
  std::printf("casadi.inverse_operations %lld\ncasadi.forward_operations %lld\n",
              (long long)inverse.n_instructions(), (long long)forward.n_instructions());
}
