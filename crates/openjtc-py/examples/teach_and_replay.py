"""Teach by hand and replay: reduces the recorded positions to waypoints, and plans a motion through them within the
limits.

    python teach_and_replay.py [sim: | /dev/ttyUSB0 | http://HOST:PORT]
"""

import sys

import numpy as np
import openjtc

START = np.radians([0, 30, -60, 0, 30, 0])


def main(target: str = "sim:") -> None:
    with openjtc.connect(target) as robot:
        robot.move(START)
        with robot.teach() as teaching:
            if target == "sim:":
                # A simulated hand guides the arm along a path.
                shown = robot.plan([START, START + [0.5, 0.2, -0.2, 0, 0.3, 0], START + [0.2, 0, 0, 0.4, 0, 0]])
                robot.lead(shown)
            print("lead the arm by hand: 8 s")
            teaching.record(8)

        waypoints = teaching.waypoints(tolerance=0.02)
        print(f"{len(teaching.time)} positions became {len(waypoints)} waypoints")
        replay = robot.plan(waypoints, blend=0.02, speed=60)
        print(robot.run(replay, approach=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
