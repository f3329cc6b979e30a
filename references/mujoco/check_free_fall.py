"""Compares the free fall of random arms: the simulator's integration and MuJoCo's RK4, both in steps of 1 ms.

Usage: python check_free_fall.py [PROGRAM] [--seed N] [--arms N]
PROGRAM is the built example `free_fall` of jtc-sim; without it, cargo builds and runs it.

Each arm (random kinematics, masses, inertias, rotor inertias, gravity and state) falls for a second without friction and without drives.
The joint positions must agree to 1e-9 rad, otherwise the exit code is 1.
"""
import argparse
import pathlib
import random
import subprocess
import sys

import mujoco
import numpy as np

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOLERANCE_RAD = 1e-9


def rotation(rpy):
    """Returns Rz(yaw) Ry(pitch) Rx(roll)."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array([
        [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
        [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
        [-sp, cp * sr, cp * cr],
    ])


def quaternion(rpy):
    q = np.zeros(4)
    mujoco.mju_mat2Quat(q, rotation(np.array(rpy)).flatten())
    return q


def random_arm(rng):
    """Returns the parameters of one random arm, which is always physically possible."""
    uniform = rng.uniform
    joints = [[uniform(-0.4, 0.4) for _ in range(3)] + [uniform(-3.1, 3.1) for _ in range(3)] for _ in range(7)]
    links = []
    for _ in range(7):
        origin = [uniform(-0.2, 0.2) for _ in range(3)] + [uniform(-3.1, 3.1) for _ in range(3)]
        # Second moments of mass along three axes give principal moments that keep the triangle inequality.
        a, b, c = (uniform(1e-4, 5e-2) for _ in range(3))
        tilt = rotation(np.array([uniform(-3.1, 3.1) for _ in range(3)]))
        inertia = tilt @ np.diag([b + c, a + c, a + b]) @ tilt.T
        inertia = [inertia[0, 0], inertia[0, 1], inertia[0, 2], inertia[1, 1], inertia[1, 2], inertia[2, 2]]
        links.append(origin + inertia + [uniform(0.2, 8.0)])
    return {
        "joints": joints,
        "links": links,
        "gravity": [uniform(-10, 10) for _ in range(3)],
        "rotor": [uniform(0.05, 1.0) for _ in range(6)],
        "q": [uniform(-3, 3) for _ in range(6)],
        "qd": [uniform(-1, 1) for _ in range(6)],
    }


def line(arm):
    numbers = sum(arm["joints"], []) + sum(arm["links"], [])
    numbers += arm["gravity"] + arm["rotor"] + arm["q"] + arm["qd"]
    return " ".join(repr(float(x)) for x in numbers)


def words(numbers):
    return " ".join(repr(float(x)) for x in numbers)


def body(arm, i):
    """Returns link i+1 and everything that it carries, as MJCF. The flange (joint 6) is fixed and carries nothing."""
    joint, link = arm["joints"][i], arm["links"][i + 1]
    r = rotation(np.array(link[3:6]))
    ixx, ixy, ixz, iyy, iyz, izz = link[6:12]
    inertia = r @ np.array([[ixx, ixy, ixz], [ixy, iyy, iyz], [ixz, iyz, izz]]) @ r.T
    full = [inertia[0, 0], inertia[1, 1], inertia[2, 2], inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    inner = body(arm, i + 1) if i < 5 else ""
    return (
        f'<body pos="{words(joint[:3])}" quat="{words(quaternion(joint[3:]))}">'
        f'<joint type="hinge" axis="0 0 1" armature="{arm["rotor"][i]!r}" damping="0"/>'
        f'<inertial pos="{words(link[:3])}" mass="{link[12]!r}" fullinertia="{words(full)}"/>'
        f"{inner}</body>"
    )


def mujoco_fall(arm):
    xml = (
        f'<mujoco><compiler angle="radian" boundmass="0" boundinertia="0" inertiafromgeom="false"/>'
        f'<option timestep="0.001" integrator="RK4" gravity="{words(arm["gravity"])}">'
        f'<flag constraint="disable" contact="disable"/></option>'
        f"<worldbody>{body(arm, 0)}</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = arm["q"], arm["qd"]
    for _ in range(1000):
        mujoco.mj_step(model, data)
    return data.qpos.copy()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seed", type=int, default=random.randrange(1 << 32))
    parser.add_argument("--arms", type=int, default=40)
    parser.add_argument("program", nargs="?", help="the built example; default: cargo builds and runs it")
    options = parser.parse_args()
    print(f"mujoco {mujoco.__version__}, seed {options.seed}, {options.arms} arms")

    rng = random.Random(options.seed)
    arms = [random_arm(rng) for _ in range(options.arms)]
    command = [options.program] if options.program else [
        "cargo", "run", "--quiet", "--release", "-p", "jtc-sim", "--example", "free_fall"]
    text = "\n".join(line(arm) for arm in arms) + "\n"
    ran = subprocess.run(command, input=text, capture_output=True, text=True, cwd=ROOT)
    if ran.returncode != 0:
        sys.exit(f"{' '.join(command)} failed:\n{ran.stderr}")
    ours = [np.array([float(x) for x in row.split()]) for row in ran.stdout.splitlines()]
    if len(ours) != len(arms):
        sys.exit(f"{len(ours)} answers for {len(arms)} arms")

    worst = 0.0
    for number, (arm, q) in enumerate(zip(arms, ours)):
        difference = np.abs(q - mujoco_fall(arm)).max()
        worst = max(worst, difference)
        if not difference <= TOLERANCE_RAD:
            print(f"arm {number}: {difference:.3e} rad after 1 s", file=sys.stderr)
    print(f"largest difference after 1 s: {worst:.3e} rad (allowed {TOLERANCE_RAD:.0e})")
    sys.exit(0 if worst <= TOLERANCE_RAD else 1)


if __name__ == "__main__":
    main()
