"""First motion: moves the arm to a position and along an example trajectory, and writes a report.

    python first_motion.py                       # a simulated arm
    python first_motion.py /dev/ttyUSB0          # a real arm: read the page on safety first
"""

import sys

import openjtc


def main(target: str = "sim:") -> None:
    with openjtc.connect(target) as robot:
        print(f"{robot.arm.name}: {robot.status.waiting_for}")
        print(robot.move([0, 30, -60, 0, 30, 0], degrees=True, speed=50))

        # `approach` moves the arm to the first point if the arm is at another position.
        run = robot.run(openjtc.example("motion"), approach=True)
        print(run)
        print("report:", run.report("first_motion.html", overwrite=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
