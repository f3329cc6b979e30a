"""Compares your own controller with openjtc's controller, in simulation and on the same motion.

    python own_controller.py

Both controllers move the same arm, whose masses and friction differ slightly from the arm file. openjtc's controller is used over the
serial line. Your own controller is a PD law with gravity compensation that uses the same drives. The program prints the errors of both
controllers.
"""

import numpy as np

from openjtc import Arm, Trajectory
from openjtc.control import encode
from openjtc.dynamics import Dynamics
from openjtc.sim import Plant, Simulator

SEED = 7
SECONDS = 4.0
OFFSET = np.array([0.8, 0.5, -0.7, 0.4, 0.6, -0.9])


def there_and_back(start, u, period):
    """Returns positions, velocities and accelerations of a smooth path to `start + OFFSET` and back; `u` is the time divided by `period`."""
    w = 2 * np.pi
    s, ds, dds = (1 - np.cos(w * u)) / 2, w / 2 * np.sin(w * u), w**2 / 2 * np.cos(w * u)
    return start + np.outer(s, OFFSET), np.outer(ds, OFFSET) / period, np.outer(dds, OFFSET) / period**2


def ours(arm, motion, wanted):
    simulator = Simulator(arm, seed=SEED)
    simulator.bring_up()
    simulator.command(*encode.trajectory(motion), encode.execute())
    errors = []
    while simulator.telemetry.trajectory == "Execute":
        errors.append(wanted[min(simulator.telemetry.point, len(wanted) - 1)] - simulator.position)
        simulator.step()
    return np.array(errors)


def own(arm, wanted, velocity):
    plant, model = Plant(arm, seed=SEED, start=wanted[0]), Dynamics(arm)
    kp, kd = np.array([2000, 2000, 1500, 400, 400, 200.0]), np.array([120, 120, 80, 15, 15, 8.0])
    state, errors = plant.state, []
    for q, qd in zip(wanted, velocity):
        torque = model.gravity(state.position) + kp * (q - state.position) + kd * (qd - state.velocity)
        state = plant.step(torque)
        errors.append(q - plant.true_position)
    return np.array(errors)


if __name__ == "__main__":
    arm = Arm.avena()
    start = Simulator(arm, seed=SEED).position
    motion = Trajectory(20, *there_and_back(start, np.linspace(0, 1, int(50 * SECONDS) + 1), SECONDS))
    wanted, velocity, _ = there_and_back(start, np.linspace(0, 1, int(1000 * SECONDS) + 1), SECONDS)
    for name, errors in [("openjtc", ours(arm, motion, wanted)), ("PD + gravity", own(arm, wanted, velocity))]:
        rms = 1000 * np.sqrt((errors**2).mean(axis=0))
        print(f"{name:>13}: RMS errors of the joints {np.round(rms, 2)} mrad, mean {rms.mean():.2f} mrad")
