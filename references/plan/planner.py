"""Plans of the example `plans` of jtc-plan, and plans of other projects' planners for the same motions."""

import subprocess
import time

import numpy as np
import ruckig
import toppra
import toppra.algorithm
import toppra.constraint
from scipy.interpolate import BPoly

toppra.setup_logging("ERROR")


def words(kind, *parts):
    """Returns a line of text, with 17 digits per number so that nothing is lost."""
    return kind + " " + " ".join(repr(float(v)) for part in parts for v in np.ravel(part)) + "\n"


def answers(program, lines):
    """Returns the program's answers to these lines."""
    run = subprocess.run([program], input="".join(lines), capture_output=True, text=True)
    if run.returncode != 0:
        raise SystemExit(f"{program} ended with {run.returncode}: {run.stderr.strip()}")
    return [np.array(line.split(), dtype=float) for line in run.stdout.splitlines()]


def ruckig_duration(start, end, velocity, acceleration, jerk):
    """Returns Ruckig's duration of a move from rest to rest. Waypoints are not used, because Ruckig would send them to a server."""
    given = ruckig.InputParameter(6)
    given.current_position, given.target_position = list(start), list(end)
    given.max_velocity, given.max_acceleration, given.max_jerk = list(velocity), list(acceleration), list(jerk)
    trajectory = ruckig.Trajectory(6)
    result = ruckig.Ruckig(6).calculate(given, trajectory)
    if result not in (ruckig.Result.Working, ruckig.Result.Finished):
        raise SystemExit(f"Ruckig: {result}")
    return trajectory.duration


class SampledPath(toppra.interpolator.AbstractGeometricPath):
    """A path through positions, with given first and second derivatives."""

    def __init__(self, rows):
        self.s = rows[:, 0]
        derivatives = np.stack([rows[:, 1:7], rows[:, 7:13], rows[:, 13:19]], axis=1)
        self.curves = [BPoly.from_derivatives(self.s, derivatives)]
        self.curves += [self.curves[0].derivative(k) for k in (1, 2)]

    def __call__(self, positions, order=0):
        return self.curves[order](positions)

    @property
    def dof(self):
        return 6

    @property
    def path_interval(self):
        return np.array([self.s[0], self.s[-1]])

    @property
    def waypoints(self):
        return None


def toppra_duration(rows, velocity, acceleration, inverse=None, torque=None):
    """Returns the duration of the fastest motion along a path, and the time to compute it, both in s. The path has the rows that the
    example prints."""
    scheme = toppra.constraint.DiscretizationType.Interpolation
    begin = time.perf_counter()
    path = SampledPath(rows)
    both = lambda limit: np.stack([-np.asarray(limit), np.asarray(limit)], axis=1)
    constraints = [
        toppra.constraint.JointVelocityConstraint(both(velocity)),
        toppra.constraint.JointAccelerationConstraint(both(acceleration), discretization_scheme=scheme),
    ]
    if inverse is not None:
        constraints.append(
            toppra.constraint.JointTorqueConstraint(inverse, both(torque), np.zeros(6), discretization_scheme=scheme)
        )
    # A spline through the result, which is the default, would change its duration.
    solver = toppra.algorithm.TOPPRA(constraints, path, gridpoints=path.s, parametrizer="ParametrizeConstAccel")
    trajectory = solver.compute_trajectory(0, 0)
    taken = time.perf_counter() - begin
    if trajectory is None:
        raise SystemExit("toppra found no motion")
    return trajectory.duration, taken
