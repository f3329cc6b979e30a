// The arm and the states of a file in the line format of the example `reference`, and a clock for calls on them.
#pragma once
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <sstream>
#include <string>
#include <vector>

struct Origin {
  double xyz[3], rpy[3];
};

struct Link {
  Origin origin;
  double inertia[6], mass;
};

struct State {
  double q[6], qd[6], qdd[6], tau[6], rotor[6];
};

struct Arm {
  Origin joints[7];
  Link links[7];
  double gravity[3];
  std::vector<State> states;
};

static_assert(sizeof(Origin) == 6 * sizeof(double) && sizeof(Link) == 13 * sizeof(double), "plain numbers");

inline Arm read_arm(int argc, char** argv) {
  Arm arm;
  std::ifstream file(argc > 1 ? argv[1] : "");
  std::string line, kind;
  while (std::getline(file, line)) {
    std::istringstream words(line);
    words >> kind;
    auto take = [&](double* to, int n) {
      for (int i = 0; i < n; ++i) words >> to[i];
    };
    if (kind == "model") {
      take(&arm.joints[0].xyz[0], 42);
      take(&arm.links[0].origin.xyz[0], 91);
      take(arm.gravity, 3);
    } else if (kind == "state") {
      State s;
      take(s.q, 30);
      arm.states.push_back(s);
    }
    if (!words) std::exit((std::fprintf(stderr, "bad line: %s\n", line.c_str()), 1));
  }
  if (arm.states.empty()) std::exit((std::fprintf(stderr, "usage: program FILE\n"), 1));
  return arm;
}

// Rz(yaw) Ry(pitch) Rx(roll), row major.
inline std::array<double, 9> rpy_matrix(const double* rpy) {
  double sr = std::sin(rpy[0]), cr = std::cos(rpy[0]), sp = std::sin(rpy[1]), cp = std::cos(rpy[1]);
  double sy = std::sin(rpy[2]), cy = std::cos(rpy[2]);
  return {cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr, sy * cp, sy * sp * sr + cy * cr,
          sy * sp * cr - cy * sr, -sp, cp * sr, cp * cr};
}

// Median over batches of the nanoseconds of one call(state).
template <class Call>
void time_calls(const char* name, const Arm& arm, Call call) {
  std::vector<double> batches;
  for (int b = 0; b < 101; ++b) {
    auto begin = std::chrono::steady_clock::now();
    for (const State& s : arm.states) call(s);
    std::chrono::duration<double, std::nano> took = std::chrono::steady_clock::now() - begin;
    batches.push_back(took.count() / arm.states.size());
  }
  std::sort(batches.begin(), batches.end());
  std::printf("%s %.1f\n", name, batches[batches.size() / 2]);
}

inline void keep(const void* p) { asm volatile("" : : "r"(p) : "memory"); }
