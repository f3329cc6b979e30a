"""Compares arms that `jtc arm import` makes of other projects' robot descriptions with Pinocchio's reading of the same files.

    python check_import.py JTC [--states 40] [--seed N]

JTC is the command (`cargo build --release -p jtc-cli`). The descriptions come from the package example-robot-data. They contain axes
other than z, fixed joints between moving ones, joints without end, and grippers that are left out. Pinocchio reads the original file,
with all joints except the six fixed at 0; `jtc dynamics` reads the arm file. Gravity, inverse dynamics, mass matrix and forward dynamics
must agree to 1e-9 of the largest entry, plus the effect of right angles that the controller makes exact. The torques that `jtc arm check`
reports for its worst poses must agree to 1 mN·m, and the command must accept the file. Exit code 1 and the worst case on failure.
"""

import argparse
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np
import pinocchio as pin

import descriptions

LIMIT = 1e-9
# Largest relative change of a torque or an acceleration per change of an angle.
SENSITIVITY = 100.0
# Tolerance in N·m. In the poses that `arm check` reports, positions with little effect are set to 0.
HOLDING = 1e-3

# Each entry: file, joints for the import (none if the file has no other joints), tip for the import.
ARMS = [
    ("ur_description/urdf/ur3_robot.urdf", None, None),
    ("ur_description/urdf/ur5_robot.urdf", None, "ee_link"),
    ("ur_description/urdf/ur5_gripper.urdf", None, None),
    ("ur_description/urdf/ur10_joint_limited_robot.urdf", None, None),
    ("kinova_description/robots/kinova.urdf", None, None),
    ("so_arm_description/urdf/so100.urdf", None, None),
    ("so_arm_description/urdf/so101.urdf", None, None),
    ("z1_description/urdf/z1.urdf", "joint1,joint2,joint3,joint4,joint5,joint6", None),
    ("z1_description/urdf/z1.urdf", None, "gripperStator"),
    ("xarm_description/urdf/xarm7.urdf", "joint1,joint2,joint4,joint5,joint6,joint7", None),
    ("panda_description/urdf/panda.urdf", "panda_joint1,panda_joint2,panda_joint3,panda_joint4,panda_joint5,panda_joint6", None),
    ("b1_description/urdf/b1-z1.urdf", "joint1,joint2,joint3,joint4,joint5,joint6", None),
]


def run(command, lines=None):
    done = subprocess.run([str(c) for c in command], input=lines, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{' '.join(map(str, command))} ended with {done.returncode}: {done.stdout}{done.stderr}")
    return done.stdout


def reference(path, joints, gravity, base):
    """Returns Pinocchio's model of the original: all joints except the six are fixed at 0, the joints have our order, and gravity is
    that of the arm file."""
    whole = pin.buildModelFromUrdf(str(path))
    held = [k for k, name in enumerate(whole.names) if k > 0 and name not in joints]
    model = pin.buildReducedModel(whole, held, pin.neutral(whole)) if held else whole
    # The arm file's gravity is in the frame of its base.
    data = model.createData()
    pin.framesForwardKinematics(model, data, pin.neutral(model))
    turn = data.oMf[model.getFrameId(base)].rotation
    model.gravity.linear, model.gravity.angular = turn @ np.array(gravity), np.zeros(3)
    assert [name for name in model.names if name in joints] == joints, list(model.names)
    return model, model.createData()


def configuration(model, joints, q):
    """Converts joint positions. Pinocchio represents joints without end by a cosine and a sine."""
    full = pin.neutral(model)
    for name, angle in zip(joints, q):
        joint = model.joints[model.getJointId(name)]
        full[joint.idx_q : joint.idx_q + joint.nq] = [angle] if joint.nq == 1 else [np.cos(angle), np.sin(angle)]
    return full


def answers(jtc, what, arm, rows):
    text = "\n".join(" ".join(repr(float(v)) for v in row) for row in rows) + "\n"
    return np.array([line.split() for line in run([jtc, "dynamics", what, "--arm", arm], text).splitlines()], dtype=float)


def worst_error(got, want):
    scale = np.maximum(np.abs(want).max(axis=1), 1e-12)
    return float(np.nan_to_num(np.abs(got - want).max(axis=1) / scale, nan=np.inf).max())


def compare(jtc, folder, rng, states, row):
    file, joints, tip = row
    file = descriptions.folder() / file
    arm = folder / "arm.toml"
    options = [*(["--joints", joints] if joints else []), *(["--tip", tip] if tip else [])]
    report = json.loads(run([jtc, "--json", "arm", "import", file, *options, "-o", arm, "--overwrite"]))
    checked = json.loads(run([jtc, "--json", "arm", "check", arm]))
    shown = json.loads(run([jtc, "--json", "arm", "show", arm]))
    gravity = [v["value"] for v in shown["values"] if v["name"].startswith("gravity")]
    names = report["joints"]
    model, data = reference(file, names, gravity, report["links"][0])
    q, qd = rng.uniform(-np.pi, np.pi, (states, 6)), rng.uniform(-3, 3, (states, 6))
    qdd, tau = rng.uniform(-10, 10, (states, 6)), rng.uniform(-30, 30, (states, 6))
    zero = np.zeros((states, 6))
    full = [configuration(model, names, row) for row in q]
    want = {
        "gravity": [pin.computeGeneralizedGravity(model, data, f).copy() for f in full],
        "inverse": [pin.rnea(model, data, f, v, a).copy() for f, v, a in zip(full, qd, qdd)],
        "mass": [symmetric(pin.crba(model, data, f)).ravel() for f in full],
        "forward": [pin.aba(model, data, f, v, t).copy() for f, v, t in zip(full, qd, tau)],
    }
    got = {
        "gravity": answers(jtc, "inverse", arm, np.hstack([q, zero, zero])),
        "inverse": answers(jtc, "inverse", arm, np.hstack([q, qd, qdd])),
        "mass": answers(jtc, "mass", arm, q),
        "forward": answers(jtc, "forward", arm, np.hstack([q, qd, tau])),
    }
    errors = {what: worst_error(got[what], np.array(want[what])) for what in want}
    holding = worst_holding(model, data, names, checked["holding"])
    limit = LIMIT + SENSITIVITY * snapped([v["value"] for v in shown["values"] if v["name"].startswith("origin_rpy")])
    bad = [what for what, error in errors.items() if error > limit]
    return errors, holding, bad, [f["what"] for f in checked["findings"] if f["severity"] == "problem"]


def snapped(angles):
    """Returns the sum in rad of the deviations of angles within 2 µrad of a right angle, which are treated as right angles (J-40)."""
    off = np.abs(np.array(angles) - np.round(np.array(angles) / (np.pi / 2)) * (np.pi / 2))
    return off[off < 2e-6].sum()


def symmetric(upper):
    return np.triu(upper) + np.triu(upper, 1).T


def worst_holding(model, data, names, holding):
    """Returns the largest difference in N·m between the torques of `arm check` for its worst poses and Pinocchio's torques."""
    errors = []
    for h in holding:
        torque = pin.computeGeneralizedGravity(model, data, configuration(model, names, h["pose_rad"]))
        errors.append(abs(abs(torque[h["joint"] - 1]) - h["torque_nm"]))
    return max(errors)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("jtc")
    parser.add_argument("--states", type=int, default=40)
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = args.seed if args.seed is not None else int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}: {len(ARMS)} arms in {args.states} states, Pinocchio {pin.__version__}")
    rng = np.random.default_rng(seed)
    failed = False
    with tempfile.TemporaryDirectory() as folder:
        for row in ARMS:
            errors, holding, far, problems = compare(args.jtc, pathlib.Path(folder), rng, args.states, row)
            bad = far or holding > HOLDING or problems
            failed |= bool(bad)
            figures = "  ".join(f"{what} {error:.1e}" for what, error in [*errors.items(), ("holding", holding)])
            print(f"{pathlib.Path(row[0]).stem:26} {figures}  {'FAILED' if bad else 'ok'}")
            if problems:
                print("  refused:", "; ".join(problems))
    sys.exit(1 if failed else 0)


if __name__ == "__main__":
    main()
