"""Tests of dynamics and kinematics: properties of every arm, and a comparison with Pinocchio, which shares no code with the package."""

import re
import threading
import time

import numpy as np
import pytest

from openjtc import Arm, RefusedError, UsageError
from openjtc.dynamics import Dynamics, Payload

PAYLOAD = Payload(2.5, (0.02, -0.03, 0.08), (0.02, 0.001, -0.002, 0.03, 0.0005, 0.025))


@pytest.fixture(scope="module")
def arm():
    return Arm.avena()


@pytest.fixture
def states(request):
    """Returns random positions, velocities, accelerations and torques. The function prints the seed, so that a failed test shows it."""
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print("seed", seed)
    rng = np.random.default_rng(seed)
    return [rng.uniform(-1, 1, (200, 6)) * scale for scale in (np.pi, 2.0, 10.0, 80.0)]


@pytest.mark.parametrize("payload", [None, PAYLOAD])
def test_the_mass_matrix_is_symmetric_and_positive_definite(arm, states, payload):
    q = states[0]
    matrix = Dynamics(arm, payload).mass_matrix(q)
    assert matrix.shape == (200, 6, 6)
    assert np.array_equal(matrix, matrix.transpose(0, 2, 1))
    assert np.linalg.eigvalsh(matrix).min() > 0


@pytest.mark.parametrize("payload", [None, PAYLOAD])
def test_forward_is_the_inverse_of_inverse(arm, states, payload):
    q, qd, qdd, _ = states
    dynamics = Dynamics(arm, payload)
    tau = dynamics.inverse(q, qd, qdd)
    assert np.allclose(dynamics.forward(q, qd, tau, rotors=False), qdd, rtol=0, atol=1e-7)
    with_rotors = tau + dynamics.rotor_inertia * qdd
    assert np.allclose(dynamics.forward(q, qd, with_rotors), qdd, rtol=0, atol=1e-7)


def test_the_columns_of_the_mass_matrix_are_differences_of_inverse_dynamics(arm, states):
    q = states[0]
    dynamics = Dynamics(arm)
    rest = np.zeros(6)
    gravity = dynamics.gravity(q)
    assert np.allclose(dynamics.inverse(q, rest, rest), gravity, rtol=0, atol=1e-10)
    columns = [dynamics.inverse(q, rest, unit) - gravity for unit in np.eye(6)]
    assert np.allclose(np.stack(columns, axis=2), dynamics.mass_matrix(q), rtol=0, atol=1e-9)


def test_without_gravity_nothing_is_held(arm):
    q = [0.1, 0.5, -1.0, 0.2, 0.3, 0.4]
    assert np.array_equal(Dynamics(arm, gravity=[0, 0, 0]).gravity(q), np.zeros(6))
    assert np.allclose(Dynamics(arm, gravity=[0, 0, 9.81]).gravity(q), -Dynamics(arm, gravity=[0, 0, -9.81]).gravity(q))


def test_the_jacobian_maps_velocities_and_forces(arm, states):
    q, qd, _, _ = states
    dynamics = Dynamics(arm)
    h = 1e-6
    before, after = dynamics.forward_kinematics(q - h * qd), dynamics.forward_kinematics(q + h * qd)
    twist = np.einsum("nij,nj->ni", dynamics.jacobian(q), qd)
    assert np.allclose((after - before)[:, :3, 3] / (2 * h), twist[:, :3], rtol=0, atol=1e-7)
    here = dynamics.forward_kinematics(q)[:, :3, :3]
    spin = (after - before)[:, :3, :3] / (2 * h) @ here.transpose(0, 2, 1)
    assert np.allclose(np.stack([spin[:, 2, 1], spin[:, 0, 2], spin[:, 1, 0]], axis=1), twist[:, 3:], rtol=0, atol=1e-7)
    # The torques of a point mass at the flange are the transposed Jacobian times its weight.
    more = Dynamics(arm, Payload(1.0)).gravity(q) - dynamics.gravity(q)
    force = -arm.gravity
    assert np.allclose(np.einsum("nij,i->nj", dynamics.jacobian(q)[:, :3], force), more, rtol=0, atol=1e-9)


def test_poses_are_reached_again(arm, states):
    limits = arm.limits
    q = np.clip(states[0], limits["position_min"], limits["position_max"])[:50]
    dynamics = Dynamics(arm)
    poses = dynamics.forward_kinematics(q)
    assert np.allclose(dynamics.frames(q)[:, 6], poses, rtol=0, atol=1e-14)
    found = dynamics.inverse_kinematics(poses, q)
    assert np.allclose(found, q, rtol=0, atol=1e-6)
    assert np.allclose(dynamics.forward_kinematics(found), poses, rtol=0, atol=2e-9)
    every = dynamics.all_inverse_kinematics(poses[0])
    assert every.shape[1] == 6 and np.abs(every - q[0]).max(axis=1).min() < 1e-6
    assert np.allclose(dynamics.forward_kinematics(every), poses[0], rtol=0, atol=2e-9)


def test_a_pose_out_of_reach_is_refused_with_reasons(arm):
    dynamics = Dynamics(arm)
    far = np.eye(4)
    far[0, 3] = 9.0
    with pytest.raises(RefusedError, match="out of reach"):
        dynamics.inverse_kinematics(far, np.zeros(6))
    both = np.stack([dynamics.forward_kinematics([0.1, 0.4, -0.8, 0.2, 0.5, 0]), far])
    with pytest.raises(RefusedError, match="row 1: out of reach"):
        dynamics.inverse_kinematics(both, [0.1, 0.4, -0.8, 0.2, 0.5, 0])
    with pytest.raises(UsageError):
        dynamics.inverse_kinematics(np.zeros((4, 4)), np.zeros(6))


def test_one_state_and_many_mix(arm):
    dynamics = Dynamics(arm)
    q = np.random.default_rng(4).uniform(-1, 1, (5, 6))
    one = [0.1] * 6
    assert dynamics.inverse(one, one, one).shape == (6,)
    mixed = dynamics.inverse(q, one, np.zeros((5, 6)))
    assert mixed.shape == (5, 6)
    assert np.array_equal(mixed[3], dynamics.inverse(q[3], one, np.zeros(6)))
    assert dynamics.gravity(q[:1]).shape == (1, 6)
    assert dynamics.gravity(np.zeros((0, 6))).shape == (0, 6)
    assert dynamics.mass_matrix(one).shape == (6, 6) and dynamics.mass_matrix(q).shape == (5, 6, 6)
    assert dynamics.frames(one).shape == (7, 4, 4) and dynamics.jacobian(q).shape == (5, 6, 6)
    for strange in (q[:, ::-1], q.astype(np.float32), np.asfortranarray(q), q.tolist()):
        assert np.array_equal(dynamics.gravity(strange), dynamics.gravity(np.array(strange, dtype=float)))


def test_wrong_arguments_are_explained(arm):
    dynamics = Dynamics(arm)
    zeros = np.zeros(6)
    with pytest.raises(UsageError, match=re.escape("q: shape [5], expected (6,) or (N, 6)")):
        dynamics.inverse(zeros[:5], zeros, zeros)
    with pytest.raises(UsageError, match="q has 3 rows, but qdd has 2"):
        dynamics.inverse(np.zeros((3, 6)), zeros, np.zeros((2, 6)))
    with pytest.raises(UsageError, match="qd: joint 4 is not finite: NaN"):
        dynamics.inverse(zeros, [0, 0, 0, np.nan, 0, 0], zeros)
    with pytest.raises(UsageError, match="mass is -1 kg"):
        Dynamics(arm, Payload(-1.0))
    with pytest.raises(UsageError, match="not finite"):
        Dynamics(arm, gravity=[0, 0, np.inf])


def test_friction_is_odd_and_that_of_the_file(arm):
    dynamics = Dynamics(arm)
    qd = np.random.default_rng(1).uniform(-1.4, 1.4, (40, 6))
    friction = dynamics.friction(qd, 30.0)
    assert np.allclose(dynamics.friction(-qd, 30.0), -friction, rtol=0, atol=1e-12)
    assert np.all(np.sign(friction) == np.sign(qd))
    c = arm.friction
    speed = np.abs(qd)
    powers = sum(c[:, k] * speed**k for k in range(4))
    expected = np.sign(qd) * np.clip(1 + c[:, 4] * (30.0 - c[:, 5]), 0.2, 2) * powers
    fast = speed > 0.1  # at lower speeds, the sign function is replaced by a straight line
    assert np.allclose(friction[fast], expected[fast], rtol=1e-12)
    assert not np.array_equal(dynamics.friction(qd, [20, 30, 40, 50, 20, 30]), friction)


def test_other_threads_run_meanwhile(arm):
    dynamics = Dynamics(arm)
    q = np.random.default_rng(2).uniform(-3, 3, (200_000, 6))
    begun, ran = threading.Event(), []

    def compute():
        begun.set()
        dynamics.mass_matrix(q)
        ran.append("computed")

    thread = threading.Thread(target=compute)
    thread.start()
    begun.wait()
    while thread.is_alive() and not ran:
        ran.append("meanwhile")
        time.sleep(0)
    thread.join()
    assert ran[0] == "meanwhile"


def right_angles(urdf):
    """Rounds joint angles close to a right angle to that angle, like the package."""

    def snap(text):
        angles = np.array([float(x) for x in text.split()])
        quarters = np.round(angles / (np.pi / 2)) * (np.pi / 2)
        return " ".join(repr(float(x)) for x in np.where(np.abs(angles - quarters) <= 2e-6, quarters, angles))

    joint = re.compile(r"<joint\b.*?</joint>", re.DOTALL)
    rpy = re.compile(r'rpy="([^"]*)"')
    return joint.sub(lambda m: rpy.sub(lambda r: f'rpy="{snap(r[1])}"', m[0]), urdf)


@pytest.mark.parametrize("payload", [None, PAYLOAD])
def test_pinocchio_computes_the_same(arm, states, payload):
    pin = pytest.importorskip("pinocchio")
    model = pin.buildModelFromXML(right_angles(arm.to_urdf()))
    flange = model.getFrameId([f.name for f in model.frames if f.type == pin.FrameType.BODY][-1])
    model.gravity.linear = arm.gravity
    if payload is not None:
        xx, xy, xz, yy, yz, zz = payload.inertia
        inertia = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        frame = model.frames[flange]
        joint = getattr(frame, "parentJoint", None)
        joint = frame.parent if joint is None else joint
        body = pin.Inertia(payload.mass, np.array(payload.com), inertia)
        model.appendBodyToJoint(joint, body, frame.placement)
    data = model.createData()
    dynamics = Dynamics(arm, payload)
    q, qd, qdd, tau = states
    got = {
        "inverse": dynamics.inverse(q, qd, qdd),
        "gravity": dynamics.gravity(q),
        "mass matrix": dynamics.mass_matrix(q),
        "forward": dynamics.forward(q, qd, tau, rotors=False),
        "flange": dynamics.forward_kinematics(q),
        "jacobian": dynamics.jacobian(q),
    }
    for k in range(len(q)):
        upper = np.triu(pin.crba(model, data, q[k]))
        want = {
            "inverse": pin.rnea(model, data, q[k], qd[k], qdd[k]).copy(),
            "gravity": pin.computeGeneralizedGravity(model, data, q[k]).copy(),
            "mass matrix": upper + np.triu(upper, 1).T,
            "forward": pin.aba(model, data, q[k], qd[k], tau[k]).copy(),
        }
        pin.framesForwardKinematics(model, data, q[k])
        want["flange"] = data.oMf[flange].homogeneous.copy()
        want["jacobian"] = pin.computeFrameJacobian(model, data, q[k], flange, pin.LOCAL_WORLD_ALIGNED).copy()
        for name, value in want.items():
            error = np.abs(got[name][k] - value).max() / np.abs(value).max()
            assert error < 1e-9, f"{name} of state {k}: {error:.1e}"
