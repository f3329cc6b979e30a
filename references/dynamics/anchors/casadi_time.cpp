// The generated C of casadi_generate.cpp.
#include "arm.hpp"

extern "C" {
int inverse(const double** arg, double** res, long long* iw, double* w, int mem);
int forward(const double** arg, double** res, long long* iw, double* w, int mem);
}

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  static double work[4096];
  double out[6];
  double* res[] = {out};
  time_calls("casadi.inverse", arm, [&](const State& s) {
    const double* in[] = {s.q, s.qd, s.qdd};
    inverse(in, res, nullptr, work, 0), keep(out);
  });
  time_calls("casadi.forward", arm, [&](const State& s) {
    const double* in[] = {s.q, s.qd, s.tau};
    forward(in, res, nullptr, work, 0), keep(out);
  });
}
