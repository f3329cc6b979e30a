"""Gymnasium environment with the simulated arm: reach joint positions with torques, 50 decisions per second.

    pip install './openjtc-0.2.0-….whl[gym]'    # the wheel of a release, by its full name; if it is installed, only `pip install gymnasium`
    python gym_environment.py

The program checks the environment and runs a scripted policy in it. The actions are shares of the largest torques of the drives.
"""

import gymnasium as gym
import numpy as np
from gymnasium.utils.env_checker import check_env

from openjtc import Arm
from openjtc.dynamics import Dynamics
from openjtc.sim import Plant


class Reach(gym.Env):
    """The observation contains positions, velocities and the goal. The reward is minus the distance to the goal. If a drive trips, the
    reward is 100 lower."""

    def __init__(self, seconds=5.0):
        self.plant = Plant(Arm.avena())
        self.action_space = gym.spaces.Box(-1.0, 1.0, (6,), np.float64)
        self.observation_space = gym.spaces.Box(-10.0, 10.0, (18,), np.float64)
        self.seconds = seconds

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        self.goal = self.np_random.uniform(-0.5, 0.5, 6)
        state = self.plant.reset(self.np_random.uniform(-0.3, 0.3, 6))
        return self.observed(state), {}

    def step(self, action):
        state = self.plant.step(action * self.plant.torque_max, ms=20)
        distance = float(np.linalg.norm(self.plant.true_position - self.goal))
        reward = -distance - 100.0 * state.faulted
        return self.observed(state), reward, state.faulted, state.time >= self.seconds, {"distance": distance}

    def observed(self, state):
        return np.concatenate([state.position, state.velocity, self.goal])


if __name__ == "__main__":
    check_env(Reach(), skip_render_check=True)
    print("the environment passes the check of Gymnasium")
    environment, model = Reach(), Dynamics(Arm.avena())
    kp, kd = np.array([150, 150, 100, 30, 30, 15.0]), np.array([60, 60, 40, 8, 8, 4.0])
    for seed in range(3):
        observation, _ = environment.reset(seed=seed)
        ended, total = False, 0.0
        while not ended:
            q, qd, goal = observation.reshape(3, 6)
            torque = model.gravity(q) + kp * np.clip(goal - q, -0.3, 0.3) + model.friction(goal - q) - kd * qd
            observation, reward, fault, over, info = environment.step(np.clip(torque / environment.plant.torque_max, -1, 1))
            ended, total = fault or over, total + reward
        print(f"seed {seed}: reward {total:.1f}, {info['distance']:.4f} rad from the goal" + (", a drive tripped" if fault else ""))
