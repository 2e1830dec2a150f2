"""One test script for a simulation and for a board: the torque of a speed step, captured.

Run: python examples/captured_step.py             the simulation
     python examples/captured_step.py PORT        a board at this port; its shaft must be free
"""

import sys

import hexatorque


def capture_speed_step(drive):
    """Torque and speed at every fast interrupt, 0.05 s before and 0.15 s after the step."""
    with drive:
        drive.set_many({"scheme": "ddr", "speed_ref_rpm": 0})
        drive.start()
        drive.run(0.6)
        drive.arm(["torque_Nm", "speed_rpm"], samples=2000, pre=500, trigger="command")
        drive.run(0.1)
        drive.set("speed_ref_rpm", 200)  # the command that triggers
        drive.run(0.5)
        drive.check()
        return drive.captured(timeout_s=5)


if __name__ == "__main__":
    if len(sys.argv) > 1:
        drive = hexatorque.BoardDrive.open(sys.argv[1])
    else:
        drive = hexatorque.SimulatedDrive(hexatorque.load("paper-a-feasible"))
    recording = capture_speed_step(drive)
    peak_Nm = max(recording["torque_Nm"])
    print(f"{len(recording)} samples at {recording.rate_Hz:g} Hz, peak torque {peak_Nm:.1f} N m")
