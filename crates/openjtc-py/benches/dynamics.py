"""Compares the dynamics of 100 000 states with Pinocchio, both called from Python as a user calls them.

    python benches/dynamics.py [--states 100000] [--rounds 3] [--json FILE]

Pinocchio (`pip install pin`) is called in a loop over the states, because its bindings have no batch call for most of these functions. For
the other functions, the benchmark uses the `parallel` extension of Pinocchio if the wheel contains it. The benchmark prints the best of
several rounds, because other programs can only slow a round down. Build the package with optimisation first
(`maturin develop --profile dist`).
"""

import argparse
import json
import time

import numpy as np

from openjtc import Arm
from openjtc.dynamics import Dynamics

try:
    import pinocchio as pin
except ImportError:
    pin = None


def best(rounds, of):
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        of()
        times.append(time.perf_counter() - begin)
    return min(times)


def anchors(arm, states):
    """Returns Pinocchio's functions by name, each over all states."""
    q, qd, qdd, tau = states
    model = pin.buildModelFromXML(arm.to_urdf())
    data = model.createData()
    flange = model.nframes - 1
    rows = range(len(q))

    def kinematics():
        for k in rows:
            pin.framesForwardKinematics(model, data, q[k])
            data.oMf[flange].homogeneous

    yield "inverse", lambda: [pin.rnea(model, data, q[k], qd[k], qdd[k]) for k in rows]
    yield "forward", lambda: [pin.aba(model, data, q[k], qd[k], tau[k]) for k in rows]
    yield "mass_matrix", lambda: [pin.crba(model, data, q[k]) for k in rows]
    yield "forward_kinematics", kinematics
    if hasattr(pin, "rneaInParallel"):
        pool = pin.ModelPool(model, 1)
        batch = [np.asfortranarray(x.T) for x in (q, qd, qdd, tau)]
        yield "inverse, batch", lambda: pin.rneaInParallel(1, pool, batch[0], batch[1], batch[2])
        yield "forward, batch", lambda: pin.abaInParallel(1, pool, batch[0], batch[1], batch[3])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--states", type=int, default=100_000)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--json")
    args = parser.parse_args()
    rng = np.random.default_rng(1)
    states = [rng.uniform(-1, 1, (args.states, 6)) * scale for scale in (np.pi, 2.0, 10.0, 80.0)]
    q, qd, qdd, tau = states
    arm = Arm.avena()
    dynamics = Dynamics(arm)
    figures = {
        "inverse": best(args.rounds, lambda: dynamics.inverse(q, qd, qdd)),
        "forward": best(args.rounds, lambda: dynamics.forward(q, qd, tau, rotors=False)),
        "mass_matrix": best(args.rounds, lambda: dynamics.mass_matrix(q)),
        "forward_kinematics": best(args.rounds, lambda: dynamics.forward_kinematics(q)),
    }
    theirs = {} if pin is None else {name: best(args.rounds, of) for name, of in anchors(arm, states)}
    print(f"{args.states} states, ns a state     openjtc  Pinocchio   ratio")
    report = {}
    for name in theirs or figures:
        mine = figures[name.removesuffix(", batch")] / args.states * 1e9
        other = theirs[name] / args.states * 1e9 if name in theirs else float("nan")
        report[name] = {"openjtc_ns": mine, "pinocchio_ns": other}
        print(f"{name:28} {mine:9.0f}  {other:9.0f}  {other / mine:6.1f}")
    if args.json:
        with open(args.json, "w") as file:
            json.dump({"states": args.states, "figures": report}, file, indent=2)


if __name__ == "__main__":
    main()
