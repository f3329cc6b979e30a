"""Compares the inverse kinematics and the lines of the flange of jtc-plan with Pinocchio, and with the eight solutions of a UR5.

    python check_kinematics.py PROGRAM [--poses 40] [--seed N]

PROGRAM is the example `poses` of the crate jtc-plan (`cargo build --release -p jtc-plan --example poses`). The arms are six axes of the
robot descriptions of example-robot-data, as read by Pinocchio, and random arms. Pinocchio's forward kinematics computes a pose from
random joint positions. Every solution for the pose must bring Pinocchio's flange there, to 1e-9 m and 1e-9 rad. Away from singular poses,
the original joint positions must be among the solutions. The results of Pinocchio's own iteration must be among them as well: always for
closed forms; a search may miss at most one in a hundred. On lines the flange must move straight and turn evenly, with the velocity and
acceleration that Pinocchio computes from the derivatives. For the UR5 the solutions must equal those of the formulas of R. S. Andersen
(Kinematics of a UR5, 2018). Exit code 1 and the worst case on failure.
"""

import argparse
import pathlib
import subprocess
import sys

import numpy as np
import pinocchio as pin

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parent.parent / "arms"))
import descriptions  # noqa: E402

LIMIT = 1e-9
# A pose is away from singular poses if the smallest singular value is at least this (m and rad are not scaled).
AWAY = 0.03
# Largest share of the results of Pinocchio's iteration that our search may miss.
MISSED = 0.01
SAMPLES = 20

# Each entry: file, joints, `True` if there is a closed form.
UR = ["shoulder_pan_joint", "shoulder_lift_joint", "elbow_joint", "wrist_1_joint", "wrist_2_joint", "wrist_3_joint"]
ARMS = [
    ("ur_description/urdf/ur3_robot.urdf", UR, True),
    ("ur_description/urdf/ur5_robot.urdf", UR, True),
    ("ur_description/urdf/ur10_robot.urdf", UR, True),
    ("z1_description/urdf/z1.urdf", [f"joint{k}" for k in range(1, 7)], True),
    ("kinova_description/robots/kinova.urdf", [f"j2s6s200_joint_{k}" for k in range(1, 7)], True),
    ("xarm_description/urdf/xarm7.urdf", [f"joint{k}" for k in (1, 2, 4, 5, 6, 7)], False),
    ("panda_description/urdf/panda.urdf", [f"panda_joint{k}" for k in (1, 2, 3, 4, 5, 6)], False),
]


class Arm:
    """Six axes, each the z axis of its frame, for Pinocchio and as text for our program."""

    def __init__(self, name, origins, closed):
        self.name, self.origins, self.closed = name, np.array(origins), closed
        self.model = pin.Model()
        parent = 0
        for k in range(6):
            parent = self.model.addJoint(parent, pin.JointModelRZ(), placement(self.origins[k]), f"joint_{k}")
        self.frame = self.model.addFrame(pin.Frame("flange", parent, placement(self.origins[6]), pin.FrameType.OP_FRAME))
        self.data = self.model.createData()

    def line(self):
        limits = np.tile([-np.pi, np.pi], 6)
        return "model " + numbers([*self.origins.ravel(), *limits])

    def flange(self, q):
        pin.framesForwardKinematics(self.model, self.data, np.asarray(q))
        return self.data.oMf[self.frame].copy()

    def jacobian(self, q):
        return pin.computeFrameJacobian(self.model, self.data, np.asarray(q), self.frame, pin.LOCAL)

    def smallest(self, q):
        return np.linalg.svd(self.jacobian(q), compute_uv=False)[-1]

    def iterate(self, target, q):
        """Returns the result of Pinocchio's closed-loop inverse kinematics, damped; None if it finds no solution."""
        for _ in range(100):
            error = pin.log6(self.flange(q).actInv(target)).vector
            if np.linalg.norm(error) < 1e-12:
                break
            j = self.jacobian(q)
            step = j.T @ np.linalg.solve(j @ j.T + min(1e-3, error @ error) * np.eye(6), error)
            q = q + step * min(1.0, 0.5 / np.abs(step).max())
        return q if np.linalg.norm(pin.log6(self.flange(q).actInv(target)).vector) < 1e-10 else None


def numbers(values):
    return " ".join(repr(float(v)) for v in values)


def placement(origin):
    return pin.SE3(pin.rpy.rpyToMatrix(*origin[3:]), np.array(origin[:3]))


def origin(placed):
    return [*placed.translation, *pin.rpy.matrixToRpy(placed.rotation)]


def described(file, joints, closed):
    """Returns the arm of a description, with all other joints held at 0; its axes are the z axes of frames on them."""
    whole = pin.buildModelFromUrdf(str(descriptions.folder() / file))
    data = whole.createData()
    zero = pin.neutral(whole)
    pin.forwardKinematics(whole, data, zero)
    frames = []
    for name in joints:
        k = whole.getJointId(name)
        pin.computeJointJacobians(whole, data, zero)
        axis = pin.getJointJacobian(whole, data, k, pin.LOCAL)[3:, whole.joints[k].idx_v]
        frames.append(data.oMi[k] * pin.SE3(pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), axis).matrix(), np.zeros(3)))
    last = frames[-1]
    frames.append(last * pin.SE3(np.eye(3), np.array([0.02, 0.0, 0.1])))
    before = [pin.SE3.Identity(), *frames[:-1]]
    origins = [origin(a.inverse() * b) for a, b in zip(before, frames)]
    return Arm(pathlib.Path(file).stem, [rounded(o) for o in origins], closed)


def rounded(values):
    """Makes right angles exact, as the project does, by removing their rounding errors."""
    values = np.array(values)
    quarters = np.round(values[3:] / (np.pi / 2)) * (np.pi / 2)
    values[3:] = np.where(np.abs(values[3:] - quarters) <= 2e-6, quarters, values[3:])
    return values


def random_arm(rng, k):
    origins = np.hstack([rng.uniform(-0.4, 0.4, (7, 3)), rng.uniform(-np.pi, np.pi, (7, 3))])
    return Arm(f"random {k}", origins, False)


def wrapped(angles):
    return (np.asarray(angles) + np.pi) % (2 * np.pi) - np.pi


def among(q, solutions):
    return len(solutions) > 0 and np.abs(wrapped(solutions - q)).max(axis=1).min() < 1e-6


def pose_numbers(pose):
    return [*pose.translation, *pin.Quaternion(pose.rotation).coeffs()]


def ask(program, lines):
    run = subprocess.run([program], input="\n".join(lines) + "\n", capture_output=True, text=True)
    if run.returncode != 0:
        sys.exit(f"{program} ended with {run.returncode}: {run.stderr.strip()}")
    answers = run.stdout.splitlines()
    wanted = sum(not line.startswith("model") for line in lines)
    if len(answers) != wanted:
        sys.exit(f"{program} gave {len(answers)} answers to {wanted} lines")
    return answers


def values(answer):
    return np.array(answer.split()[1:], dtype=float)


def check_poses(program, arm, rng, count):
    """Returns the worst residual, the number of known solutions, the number of missing ones, and the failures."""
    made = rng.uniform(-np.pi, np.pi, (count, 6))
    near = rng.uniform(-np.pi, np.pi, (count, 6))
    poses = [arm.flange(q) for q in made]
    lines = [arm.line(), *("pose " + numbers([*pose_numbers(p), *n]) for p, n in zip(poses, near))]
    worst, found, missed, failures = 0.0, 0, 0, []
    for q, p, n, answer in zip(made, poses, near, ask(program, lines)):
        if not answer.startswith("solved"):
            failures.append(f"{q}: {answer}")
            continue
        solutions = values(answer).reshape(-1, 6)
        nearest, every = solutions[0], solutions[1:]
        for solution in solutions:
            error = arm.flange(solution).actInv(p)
            worst = max(worst, np.abs(error.translation).max(), np.abs(pin.log3(error.rotation)).max())
        for a in range(len(every)):
            if len(every[:a]) and among(every[a], every[:a]):
                failures.append(f"{q}: a solution twice")
        if len(every) > (8 if arm.closed else 16):
            failures.append(f"{q}: {len(every)} solutions")
        away = arm.smallest(q) > AWAY
        if away and np.linalg.norm(every - n, axis=1).min() < np.linalg.norm(nearest - n) - 1e-6:
            failures.append(f"{q}: not the nearest")
        others = (arm.iterate(p, rng.uniform(-np.pi, np.pi, 6)) for _ in range(10))
        for other in [q, *(o for o in others if o is not None)]:
            if arm.smallest(other) > AWAY:
                found += 1
                missed += not among(other, every)
    if missed > (0 if arm.closed else MISSED * found):
        failures.append(f"{missed} of {found} solutions are missing")
    if worst > LIMIT:
        failures.append(f"residual {worst}")
    return worst, found, missed, failures


def check_lines(program, arm, rng, count):
    """Returns the number of paths, and the worst deviations from straight lines (m, rad) and of velocity and acceleration."""
    starts = rng.uniform(-np.pi, np.pi, (count, 6))
    starts = [q for q in starts if arm.smallest(q) > AWAY]
    begins = [arm.flange(q) for q in starts]
    ends = [b * pin.exp6(np.r_[rng.uniform(-0.1, 0.1, 3), np.zeros(3)]) * pin.SE3(pin.exp3(rng.uniform(-0.3, 0.3, 3)), np.zeros(3)) for b in begins]
    lines = [arm.line(), *("line " + numbers([*q, *pose_numbers(e), SAMPLES]) for q, e in zip(starts, ends))]
    paths, off, rate = 0, 0.0, 0.0
    for b, e, answer in zip(begins, ends, ask(program, lines)):
        if not answer.startswith("path"):
            continue
        paths += 1
        rows = values(answer).reshape(-1, 19)
        length = rows[-1, 0]
        turn = pin.log3(e.rotation @ b.rotation.T)
        for s, q, first, second in zip(rows[:, 0], rows[:, 1:7], rows[:, 7:13], rows[:, 13:]):
            ideal = pin.SE3(pin.exp3(turn * s / length) @ b.rotation, b.translation + (e.translation - b.translation) * s / length)
            error = arm.flange(q).actInv(ideal)
            off = max(off, np.abs(error.translation).max(), np.abs(pin.log3(error.rotation)).max())
            pin.forwardKinematics(arm.model, arm.data, q, first, second)
            pin.updateFramePlacements(arm.model, arm.data)
            velocity = pin.getFrameVelocity(arm.model, arm.data, arm.frame, pin.LOCAL_WORLD_ALIGNED).vector
            acceleration = pin.getFrameClassicalAcceleration(arm.model, arm.data, arm.frame, pin.LOCAL_WORLD_ALIGNED).vector
            wanted = np.r_[(e.translation - b.translation) / length, turn / length]
            rate = max(rate, np.abs(velocity - wanted).max(), np.abs(acceleration).max() / (1 + np.abs(second).max()))
    return paths, off, rate


def ur5_solutions(target, d1, a2, a3, d4, d5, d6):
    """Returns all solutions for the UR5 from Andersen's formulas in modified Denavit-Hartenberg frames."""

    def frame(alpha, a, d, theta):
        return pin.SE3(pin.rpy.rpyToMatrix(alpha, 0, 0), np.array([a, 0, 0])) * pin.SE3(
            pin.rpy.rpyToMatrix(0, 0, theta), np.array([0, 0, d])
        )

    def between(k, theta):
        return frame(*[(0, 0, d1), (np.pi / 2, 0, 0), (0, a2, 0), (0, a3, d4), (np.pi / 2, 0, d5), (-np.pi / 2, 0, d6)][k], theta)

    found = []
    p05 = target.act(np.array([0.0, 0.0, -d6]))
    for s1 in (1, -1):
        t1 = np.arctan2(p05[1], p05[0]) + s1 * np.arccos(d4 / np.hypot(p05[0], p05[1])) + np.pi / 2
        for s5 in (1, -1):
            p = target.translation
            t5 = s5 * np.arccos((p[0] * np.sin(t1) - p[1] * np.cos(t1) - d4) / d6)
            x, y = target.inverse().rotation[:, 0], target.inverse().rotation[:, 1]
            t6 = np.arctan2(
                (-x[1] * np.sin(t1) + y[1] * np.cos(t1)) / np.sin(t5), (x[0] * np.sin(t1) - y[0] * np.cos(t1)) / np.sin(t5)
            )
            t14 = between(0, t1).inverse() * target * between(5, t6).inverse() * between(4, t5).inverse()
            q14 = t14.translation
            reach = np.hypot(q14[0], q14[2])
            cosine = (reach**2 - a2**2 - a3**2) / (2 * a2 * a3)
            if abs(cosine) > 1:
                continue
            for t3 in (np.arccos(cosine), -np.arccos(cosine)):
                t2 = np.arctan2(-q14[2], -q14[0]) - np.arcsin(-a3 * np.sin(t3) / reach)
                t34 = between(2, t3).inverse() * between(1, t2).inverse() * t14
                found.append([t1, t2, t3, np.arctan2(t34.rotation[1, 0], t34.rotation[0, 0]), t5, t6])
    return np.array(found)


def check_ur5(program, rng, count):
    """Uses the published parameters; both sets of solutions must be equal."""
    d1, a2, a3, d4, d5, d6 = 0.089159, -0.425, -0.39225, 0.10915, 0.09465, 0.0823
    half = np.pi / 2
    dh = [(d1, 0, half), (0, a2, 0), (0, a3, 0), (d4, 0, half), (d5, 0, -half), (d6, 0, 0)]
    arm = Arm("UR5, published", [[0] * 6, *([a, 0, d, alpha, 0, 0] for d, a, alpha in dh)], True)
    states = [q for q in rng.uniform(-np.pi, np.pi, (count, 6)) if arm.smallest(q) > AWAY]
    poses = [arm.flange(q) for q in states]
    lines = [arm.line(), *("pose " + numbers([*pose_numbers(p), *np.zeros(6)]) for p in poses)]
    failures, eight = [], 0
    for q, p, answer in zip(states, poses, ask(program, lines)):
        ours = values(answer).reshape(-1, 6)[1:]
        theirs = ur5_solutions(p, d1, a2, a3, d4, d5, d6)
        eight += len(theirs) == 8
        if len(ours) != len(theirs) or not all(among(t, ours) for t in theirs) or not among(q, theirs):
            failures.append(f"{q}: {len(ours)} solutions, {len(theirs)} by the formulas")
    print(f"{arm.name}: {len(states)} poses, eight solutions for {eight} {'FAILED' if failures else 'ok'}")
    return failures if eight else ["no pose has eight solutions"]


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("program")
    parser.add_argument("--poses", type=int, default=40)
    parser.add_argument("--seed", type=int, default=None)
    args = parser.parse_args()
    seed = args.seed if args.seed is not None else int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}: {args.poses} poses and lines of each arm, Pinocchio {pin.__version__}")
    rng = np.random.default_rng(seed)
    failures = check_ur5(args.program, rng, 10 * args.poses)
    for arm in [*(described(*row) for row in ARMS), *(random_arm(rng, k) for k in range(4))]:
        worst, found, missed, bad = check_poses(args.program, arm, rng, args.poses)
        paths, off, rate = check_lines(args.program, arm, rng, args.poses)
        if off > LIMIT or rate > 1e-6:
            bad.append(f"lines: {off} off, derivatives by {rate}")
        figures = f"poses {worst:.1e}, {missed} of {found} missing; {paths} lines {off:.1e}, derivatives {rate:.1e}"
        print(f"{arm.name:16} {figures}  {'FAILED' if bad else 'ok'}")
        failures += [f"{arm.name}: {text}" for text in bad]
    for text in failures[:20]:
        print(text)
    sys.exit(1 if failures else 0)


if __name__ == "__main__":
    main()
