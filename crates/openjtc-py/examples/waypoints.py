"""From waypoints to a cycle: plans within all limits, prints the plan, and runs it three times.

    python waypoints.py [sim: | /dev/ttyUSB0 | http://HOST:PORT]
"""

import sys

import numpy as np
import openjtc

PICK = np.radians([20, 40, -70, 0, 30, 0])
PLACE = np.radians([-40, 35, -60, 0, 25, 90])
ABOVE = np.radians([0, 10, -60, 0, 50, 0])


def main(target: str = "sim:") -> None:
    with openjtc.connect(target) as robot:
        # The plan rounds corners by up to 0.1 rad. The last waypoint equals the first one.
        cycle = robot.plan([PICK, ABOVE, PLACE, ABOVE, PICK], blend=0.1, speed=80)
        print(f"{cycle.duration:.2f} s; the arm passes the waypoints at", np.round(cycle.waypoint_times, 2))
        for bound in cycle.binding[:4]:
            print(f"  {bound['from_s']:.2f} to {bound['to_s']:.2f} s: joint {bound['joint']}, {bound['limit']}")

        run = robot.run(cycle, approach=True, repeat=3)
        print(run)
        worst = max(run.joints, key=lambda joint: joint.torque_share or 0)
        print(f"{worst.name} needs the largest share of its torque: {100 * (worst.torque_share or 0):.0f} %")

        try:
            robot.plan([PICK, PICK + [0, 0, 0, 0, 0, 9]])
        except openjtc.RefusedError as error:
            print(f"refused: joint {error.joint}, {error.value:.2f} rad of {error.limit:.2f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
