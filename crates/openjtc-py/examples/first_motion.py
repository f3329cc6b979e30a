"""A first motion: the arm moves to a place and along an example, and a report is written.

    python first_motion.py                       # a simulated arm
    python first_motion.py /dev/ttyUSB0          # a real one: read the page on safety first
"""

import sys

import openjtc


def main(target: str = "sim:") -> None:
    with openjtc.connect(target) as robot:
        print(f"{robot.arm.name}: {robot.status.waiting_for}")
        print(robot.move([0, 30, -60, 0, 30, 0], degrees=True, speed=50))

        # `approach` moves an arm that stands elsewhere to the first point.
        run = robot.run(openjtc.example("motion"), approach=True)
        print(run)
        print("report:", run.report("first_motion.html", overwrite=True))


if __name__ == "__main__":
    main(*sys.argv[1:])
