// The arm and the states of a file in the line format of the example `reference`, and a clock for calls on them.
#pragma once
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
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

// Nanoseconds that this thread has had of a processor.
inline double thread_ns() {
  timespec now;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return now.tv_sec * 1e9 + now.tv_nsec;
}

// Nanoseconds of one call(state): the least of many batches.
template <class Call>
void time_calls(const char* name, const Arm& arm, Call call) {
  double least = HUGE_VAL;
  for (int b = 0; b < 101; ++b) {
    double begin = thread_ns();
    for (const State& s : arm.states) call(s);
    least = std::min(least, (thread_ns() - begin) / arm.states.size());
  }
  std::printf("%s %.1f\n", name, least);
}

inline void keep(const void* p) { asm volatile("" : : "r"(p) : "memory"); }
