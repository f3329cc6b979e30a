// MuJoCo's C library on the arm as MJCF (second argument).
#include <mujoco/mujoco.h>

#include "arm.hpp"

int main(int argc, char** argv) {
  Arm arm = read_arm(argc, argv);
  char error[500] = "";
  mjModel* m = mj_loadXML(argc > 2 ? argv[2] : "", nullptr, error, sizeof error);
  if (!m) return std::fprintf(stderr, "%s\n", error), 1;
  mjData* d = mj_makeData(m);
  auto load = [&](const State& s) {
    for (int k = 0; k < 6; ++k)
      d->qpos[k] = s.q[k], d->qvel[k] = s.qd[k], d->qacc[k] = s.qdd[k], d->qfrc_applied[k] = s.tau[k];
  };
  time_calls("mujoco.inverse", arm, [&](const State& s) { load(s), mj_inverse(m, d), keep(d->qfrc_inverse); });
  time_calls("mujoco.forward", arm, [&](const State& s) { load(s), mj_forward(m, d), keep(d->qacc); });
  m->opt.integrator = mjINT_RK4;
  time_calls("mujoco.step_rk4", arm, [&](const State& s) { load(s), mj_step(m, d), keep(d->qpos); });
  m->opt.integrator = mjINT_EULER;
  time_calls("mujoco.step_euler", arm, [&](const State& s) { load(s), mj_step(m, d), keep(d->qpos); });
}
