"""Compares jtc-dynamics with Pinocchio over random arms and states.

    python check_pinocchio.py PROGRAM [--models 100] [--states 20] [--seed N]

PROGRAM is the example `reference` of the crate jtc-dynamics (`cargo build --release -p jtc-dynamics --example reference`). Every model
has random joint origins, masses, inertias and gravity. A share of the models has parallel, nearly parallel, antiparallel or crossing
axes, and every second model carries a payload at its flange (J-60). Angles close to a right angle are treated as in J-40. Each
result must agree to 1e-9 relative to the largest entry of its vector or matrix. Needs `pin` from PyPI. Exit code 1 and the worst case on
failure.
"""

import argparse
import subprocess
import sys

import numpy as np
import pinocchio as pin
from arm import right_angles

LIMIT = 1e-9
SHAPES = [("inverse", 6), ("gravity", 6), ("mass matrix", 36), ("forward, rotors", 6), ("forward", 6), ("kinematics", 84)]


def random_inertia(rng):
    """Returns the six numbers of the inertia of some random points, which is always physically possible."""
    points = rng.normal(size=(8, 3)) * rng.uniform(0.02, 0.3)
    cov = points.T @ points / 8 * rng.uniform(0.2, 8.0)
    j = np.trace(cov) * np.eye(3) - cov
    return [j[0, 0], j[0, 1], j[0, 2], j[1, 1], j[1, 2], j[2, 2]]


def random_model(rng):
    special = np.array([0.0, np.pi / 2, -np.pi / 2, np.pi, 3.141592, 1.570796, 1e-9, 1e-6])
    joints = np.hstack([rng.uniform(-0.8, 0.8, (7, 3)), rng.uniform(-np.pi, np.pi, (7, 3))])
    if rng.random() < 0.5:
        joints[:, 3:] = rng.choice(special, (7, 3))
        joints[:, :3] *= rng.choice([0.0, 1.0], (7, 3), p=[0.4, 0.6])
    links = np.array(
        [
            np.r_[rng.uniform(-0.3, 0.3, 3), rng.uniform(-np.pi, np.pi, 3), random_inertia(rng), rng.uniform(0.2, 9)]
            for _ in range(7)
        ]
    )
    gravity = rng.normal(size=3)
    return joints, links, 9.81 * gravity / np.linalg.norm(gravity)


def random_payload(rng):
    """Returns mass, centre of mass and the inertia about it, in the flange frame."""
    return np.r_[rng.uniform(0.1, 8), rng.uniform(-0.3, 0.3, 3), random_inertia(rng)]


def pinocchio_model(joints, links, gravity, payload):
    model = pin.Model()
    joints = np.hstack([joints[:, :3], right_angles(joints[:, 3:])])
    parent = 0
    for k in range(6):
        place = pin.SE3(pin.rpy.rpyToMatrix(*joints[k, 3:]), joints[k, :3])
        parent = model.addJoint(parent, pin.JointModelRZ(), place, f"joint_{k}")
        com, rpy, inertia, mass = links[k + 1][:3], links[k + 1][3:6], links[k + 1][6:12], links[k + 1][12]
        xx, xy, xz, yy, yz, zz = inertia
        turn = pin.rpy.rpyToMatrix(*rpy)
        about_com = turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T
        model.appendBodyToJoint(parent, pin.Inertia(mass, com, about_com), pin.SE3.Identity())
    flange = pin.SE3(pin.rpy.rpyToMatrix(*joints[6, 3:]), joints[6, :3])
    if len(payload) > 0:
        xx, xy, xz, yy, yz, zz = payload[4:]
        about_com = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        model.appendBodyToJoint(parent, pin.Inertia(payload[0], payload[1:4], about_com), flange)
    model.gravity.linear = gravity
    model.gravity.angular = np.zeros(3)
    return model, model.createData(), flange


def expected(model, data, flange, q, qd, qdd, tau, rotor):
    inverse = pin.rnea(model, data, q, qd, qdd).copy()
    gravity = pin.computeGeneralizedGravity(model, data, q).copy()
    mass = pin.crba(model, data, q)
    mass = np.triu(mass) + np.triu(mass, 1).T
    bias = pin.rnea(model, data, q, qd, np.zeros(6)).copy()
    with_rotors = np.linalg.solve(mass + np.diag(rotor), tau - bias)
    without = pin.aba(model, data, q, qd, tau).copy()
    pin.forwardKinematics(model, data, q)
    poses = [data.oMi[k + 1] for k in range(6)] + [data.oMi[6] * flange]
    kinematics = np.concatenate([np.r_[p.translation, p.rotation.ravel()] for p in poses])
    return [inverse, gravity, mass.ravel(), with_rotors, without, kinematics]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--models", type=int, default=1000)
    parser.add_argument("--states", type=int, default=5)
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = args.seed if args.seed is not None else int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}: {args.models} models of {args.states} states, Pinocchio {pin.__version__}")
    rng = np.random.default_rng(seed)

    lines, wanted = [], []
    for k in range(args.models):
        joints, links, gravity = random_model(rng)
        payload = random_payload(rng) if k % 2 else np.zeros(0)
        numbers = np.r_[joints.ravel(), links.ravel(), gravity, payload]
        lines.append("model " + " ".join(repr(float(v)) for v in numbers))
        reference = pinocchio_model(joints, links, gravity, payload)
        for _ in range(args.states):
            q, qd, qdd = rng.uniform(-np.pi, np.pi, 6), rng.uniform(-3, 3, 6), rng.uniform(-10, 10, 6)
            tau, rotor = rng.uniform(-100, 100, 6), rng.uniform(0, 1, 6)
            state = np.r_[q, qd, qdd, tau, rotor]
            lines.append("state " + " ".join(repr(float(v)) for v in state))
            wanted.append(expected(*reference, q, qd, qdd, tau, rotor))
    run = subprocess.run([args.program], input="\n".join(lines) + "\n", capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"{args.program} ended with {run.returncode}: {run.stderr.strip()}")
    answers = [np.array(line.split(), dtype=float) for line in run.stdout.splitlines()]
    if len(answers) != len(wanted):
        sys.exit(f"{args.program} gave {len(answers)} answers to {len(wanted)} states")

    failed = False
    begin = 0
    for index, (name, size) in enumerate(SHAPES):
        got = np.array([a[begin : begin + size] for a in answers])
        want = np.array([w[index] for w in wanted])
        begin += size
        error = np.abs(got - want).max(axis=1) / np.maximum(np.abs(want).max(axis=1), 1e-12)
        error = np.where(np.isfinite(error), error, np.inf)
        worst = int(error.argmax())
        bad = error[worst] > LIMIT
        failed |= bad
        print(f"{name:16} worst relative error {error[worst]:.2e} {'FAILED' if bad else 'ok'}")
        if bad:
            print(f"  model {worst // args.states}, state {worst % args.states}\n  ours {got[worst]}\n  want {want[worst]}")
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
