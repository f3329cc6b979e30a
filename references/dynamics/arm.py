"""The arm file and random states as numbers, text lines (see the example `reference` of jtc-dynamics) and MJCF."""

import tomllib

import numpy as np


def read(path):
    """Returns joint origins (7×6), links (7×13) and gravity (3) of an arm file."""
    with open(path, "rb") as file:
        arm = tomllib.load(file)
    joints = np.array([j["origin_xyz_m"] + j["origin_rpy_rad"] for j in arm["joint"]], dtype=float)
    joints[:, 3:] = right_angles(joints[:, 3:])
    links = np.array(
        [k["com_xyz_m"] + k["com_rpy_rad"] + k["inertia_kg_m2"] + [k["mass_kg"]] for k in arm["link"]], dtype=float
    )
    return joints, links, np.array(arm["gravity_m_s2"], dtype=float)


def right_angles(rpy):
    """Returns angles of joint origins. An angle within 2e-6 rad of a multiple of a right angle becomes that multiple."""
    quarters = np.round(np.asarray(rpy) / (np.pi / 2)) * (np.pi / 2)
    return np.where(np.abs(rpy - quarters) <= 2e-6, quarters, rpy)


def line(kind, *parts):
    """Returns a line of text, with 17 digits per number so that nothing is lost."""
    return kind + " " + " ".join(repr(float(v)) for p in parts for v in np.ravel(p))


def states(rng, count):
    """Returns rows of q, qd, qdd, torque, rotor inertia."""
    scale = np.repeat([np.pi, 2.0, 10.0, 50.0], 6)
    return np.hstack([rng.uniform(-1, 1, (count, 24)) * scale, np.full((count, 6), 0.7)])


def rpy_matrix(rpy):
    """Returns Rz(yaw) Ry(pitch) Rx(roll)."""
    (sr, sp, sy), (cr, cp, cy) = np.sin(rpy), np.cos(rpy)
    rx = np.array([[1, 0, 0], [0, cr, -sr], [0, sr, cr]])
    ry = np.array([[cp, 0, sp], [0, 1, 0], [-sp, 0, cp]])
    rz = np.array([[cy, -sy, 0], [sy, cy, 0], [0, 0, 1]])
    return rz @ ry @ rx


def full_inertia(link):
    """Returns the inertia about the centre of mass, in the axes of the link frame."""
    xx, xy, xz, yy, yz, zz = link[6:12]
    turn = rpy_matrix(link[3:6])
    return turn @ np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ turn.T


def mjcf(joints, links, gravity, armature=None, timestep=0.001, integrator="RK4"):
    """Returns the arm for MuJoCo: no contacts, no limits, no damping."""

    def text(values):
        return " ".join(repr(float(v)) for v in values)

    body = ""
    for k in range(5, -1, -1):
        j = full_inertia(links[k + 1])
        inertia = [j[0, 0], j[1, 1], j[2, 2], j[0, 1], j[0, 2], j[1, 2]]
        rotor = "" if armature is None else f' armature="{float(armature[k])!r}"'
        x, y = rpy_matrix(joints[k, 3:])[:, 0], rpy_matrix(joints[k, 3:])[:, 1]
        body = (
            f'<body name="link_{k + 1}" pos="{text(joints[k, :3])}" xyaxes="{text([*x, *y])}">'
            f'<inertial pos="{text(links[k + 1][:3])}" mass="{float(links[k + 1][12])!r}" fullinertia="{text(inertia)}"/>'
            f'<joint name="joint_{k + 1}" type="hinge" axis="0 0 1"{rotor}/>{body}</body>'
        )
    return (
        f'<mujoco><compiler angle="radian"/><option timestep="{timestep}" integrator="{integrator}" '
        f'gravity="{text(gravity)}"><flag contact="disable" constraint="disable"/></option>'
        f"<worldbody>{body}</worldbody></mujoco>"
    )
