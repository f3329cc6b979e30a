"""Measures motions of jtc-plan, toppra and Ruckig; prints times and durations as JSON, for `cargo xtask bench`.

    python bench_plan.py PROGRAM

PROGRAM is the example `plans` of the crate jtc-plan. `plan.ms_100` and `plan.ms_400`: times to plan 100 and 400 waypoints of six joints,
with limits of jerk and torque. `plan.path_s` and `plan.toppra_s`: durations of motions along the same paths without a limit of jerk.
`plan.path_ms` and `plan.toppra_ms`: times to plan them. `plan.moves_s` and `plan.ruckig_s`: durations of motions from point to point.
"""

import json
import sys
import tomllib

import numpy as np

import planner
from check_plan import ARM_FILE, PLACES

MOVES, PATHS, BLEND = 200, 10, 0.05


def main():
    program = sys.argv[1]
    rng = np.random.default_rng(1)
    with open(ARM_FILE, "rb") as file:
        joints = tomllib.load(file)["joint"][:6]
    velocity = np.array([j["velocity_max_rad_s"] for j in joints])
    acceleration = np.array([j["acceleration_max_rad_s2"] for j in joints])
    torque = np.array([j["torque_max_nm"] for j in joints])
    jerk, none = acceleration / 0.1, np.full(6, np.inf)

    def waypoints(count):
        steps = rng.uniform(-0.4, 0.4, (count, 6))
        walk = [np.zeros(6)]
        for step in steps[1:]:
            walk.append((walk[-1] + step).clip(-1.0, 1.0))
        return np.array(walk)

    figures = {}
    for count in (100, 400):
        lines = [planner.words("limits", velocity, acceleration, jerk, torque)]
        lines += [planner.words("path", BLEND, 1, 1, waypoints(count))] * 5
        heads = [row for row in planner.answers(program, lines) if len(row) == 3]
        figures[f"plan.ms_{count}"] = 1e3 * min(head[1] for head in heads)
    figures["plan.four_times_ms_100"] = 4 * figures["plan.ms_100"]

    sums = np.zeros(4)
    for _ in range(PATHS):
        lines = [planner.words("limits", velocity, acceleration, none, torque)]
        lines.append(planner.words("path", BLEND, 0, PLACES, waypoints(6)))
        head, *rows = planner.answers(program, lines)
        theirs = planner.toppra_duration(np.array(rows), velocity, acceleration)
        sums += [head[0], 1e3 * head[1], theirs[0], 1e3 * theirs[1]]
    names = ["plan.path_s", "plan.path_ms", "plan.toppra_s", "plan.toppra_ms"]
    figures.update(zip(names, map(float, sums)))

    lines, durations = [planner.words("limits", velocity, acceleration, jerk, torque)], 0.0
    for _ in range(MOVES):
        start, end = rng.uniform(-1.5, 1.5, (2, 6))
        lines.append(planner.words("move", start, end))
        durations += planner.ruckig_duration(start, end, velocity, acceleration, jerk)
    figures["plan.moves_s"] = float(np.concatenate(planner.answers(program, lines)).sum())
    figures["plan.ruckig_s"] = durations
    print(json.dumps(figures))


if __name__ == "__main__":
    main()
