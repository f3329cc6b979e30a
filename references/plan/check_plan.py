"""Compares the durations of planned motions with those of Ruckig and toppra.

    python check_plan.py PROGRAM [--moves 300] [--paths 40] [--seed N]

PROGRAM is the example `plans` of the crate jtc-plan (`cargo build --release -p jtc-plan --example plans`). Motions from point to point
have random limits of velocity, acceleration and jerk; their durations must be within 1 % of Ruckig's. Motions along blended paths have no
limit of jerk, and some have torque limits; their durations must be within 2 % of toppra's. toppra gets the same path as positions with
two derivatives, and its torque from Pinocchio. Exit code 1 and the worst case on failure.
"""

import argparse
import pathlib
import sys
import tomllib

import numpy as np
import pinocchio as pin

import planner

HERE = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent / "dynamics"))
import arm  # noqa: E402
from check_pinocchio import pinocchio_model  # noqa: E402

ARM_FILE = HERE.parent.parent / "arms/avena.toml"
PLACES = 1500


def limits(rng, joints):
    """Returns random limits around those of the arm: velocity, acceleration, jerk, torque."""
    velocity = np.array([j["velocity_max_rad_s"] for j in joints[:6]]) * rng.uniform(0.3, 1.2, 6)
    acceleration = np.array([j["acceleration_max_rad_s2"] for j in joints[:6]]) * rng.uniform(0.2, 1.5, 6)
    torque = np.array([j["torque_max_nm"] for j in joints[:6]]) * rng.uniform(0.9, 1.2, 6)
    return velocity, acceleration, acceleration * rng.uniform(2, 50, 6), torque


def check_moves(args, rng, joints):
    lines, wanted = [], []
    for _ in range(args.moves):
        velocity, acceleration, jerk, torque = limits(rng, joints)
        start, end = rng.uniform(-1.5, 1.5, (2, 6)) * rng.choice([0.01, 0.1, 1.0])
        lines.append(planner.words("limits", velocity, acceleration, jerk, torque))
        lines.append(planner.words("move", start, end))
        wanted.append(planner.ruckig_duration(start, end, velocity, acceleration, jerk))
    got = np.concatenate(planner.answers(args.program, lines))
    return report("point to point / Ruckig", got, np.array(wanted), 0.01)


def check_paths(args, rng, joints, with_torque):
    model, data, _ = pinocchio_model(*arm.read(ARM_FILE), [])
    rotors = np.array([j["rotor_inertia_kg_m2"] for j in joints[:6]])

    def inverse(q, qd, qdd):
        return pin.rnea(model, data, q, qd, qdd) + rotors * qdd

    wanted, got = [], []
    for _ in range(args.paths):
        velocity, acceleration, _, torque = limits(rng, joints)
        count, size = rng.integers(2, 9), rng.choice([0.2, 0.6])
        waypoints = np.cumsum(rng.uniform(-size, size, (count, 6)), axis=0).clip(-1.4, 1.4)
        lines = [
            planner.words("limits", velocity, acceleration, np.full(6, np.inf), torque),
            planner.words("path", rng.choice([0.05, 0.15]), with_torque, PLACES, waypoints),
        ]
        head, *rows = planner.answers(args.program, lines)
        more = (inverse, torque) if with_torque else ()
        wanted.append(planner.toppra_duration(np.array(rows), velocity, acceleration, *more)[0])
        got.append(head[0])
    name = "blended paths, torque / toppra" if with_torque else "blended paths / toppra"
    return report(name, np.array(got), np.array(wanted), 0.02)


def report(name, got, want, limit):
    error = np.abs(got / want - 1)
    error = np.where(np.isfinite(error), error, np.inf)
    worst = int(error.argmax())
    bad = error[worst] > limit
    print(
        f"{name:32} {len(got)} durations, ours {got.sum() / want.sum():.5f} of theirs, "
        f"worst {got[worst] / want[worst]:.5f} {'FAILED' if bad else 'ok'}"
    )
    if bad:
        print(f"  case {worst}: ours {got[worst]} s, theirs {want[worst]} s, allowed {limit:.0%}")
    return bad


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--moves", type=int, default=300)
    parser.add_argument("--paths", type=int, default=40)
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = args.seed if args.seed is not None else int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    with open(ARM_FILE, "rb") as file:
        joints = tomllib.load(file)["joint"]
    failed = check_moves(args, rng, joints)
    failed |= check_paths(args, rng, joints, 0)
    failed |= check_paths(args, rng, joints, 1)
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
