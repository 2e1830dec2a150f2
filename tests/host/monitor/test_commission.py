"""The guided commissioning on the monitor's server, with a virtual board."""

import pytest
from waiting import until

from hexatorque import setups
from hexatorque.commissioning.choices import CHOICES
from hexatorque.commissioning.excitation import CommissioningError, Limits
from hexatorque.commissioning.sequence import commission
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.monitor.guided import Guided, Stoppable

BEGIN = {"steps": ["wiring"], "travel": 100}  # the brake of this board does not hold it


def course(site) -> dict:
    return site.get("/commissioning")[1]


def ended(site) -> dict:
    until(lambda: course(site)["state"] not in ("asking", "measuring"))
    return course(site)


def asked(site) -> None:
    """Begin. Before a step asks it measures a little: on a busy computer a capture may come too
    late, and its user tries again."""
    for _ in range(3):
        assert site.post("/commission/begin", BEGIN) == (200, {})
        until(lambda: course(site)["state"] != "measuring")
        if course(site)["state"] == "asking":
            return
    raise AssertionError(course(site)["problems"])


def test_a_silent_page_ends_a_step(site, board):
    """A step starts the drive again and again. It must not after the page has fallen silent."""
    answers = [True]
    with site.page(answer=lambda sent_s: {"sent_s": sent_s} if answers else None):
        asked(site)
        begun_s = board.time_s
        assert site.post("/commission/go", {"step": "wiring"}) == (200, {})
        assert site.monitored.working()  # also before the gates are on
        until(lambda: board.working)
        answers.clear()
        silent_s = board.time_s
        found = ended(site)
        off_s = board.off_s(begun_s)
        assert off_s is not None and off_s - silent_s < 2.0
        assert found["state"] == "stopped"
        assert found["problems"] == ["no page answered for 1 s (the browser did not run)"]
        assert "no page answered" in site.monitored.notice
        assert board.off_s(off_s) is None and not board.working
    assert site.monitored.drive.get("start_mode") == "drive"


@pytest.mark.parametrize(
    ("body", "words"),
    [
        (
            {"steps": ["wirin"]},
            "steps: no step 'wirin' for a machine of the kind induction: choose from wiring, "
            "resistance",
        ),
        ({"steps": []}, "steps: choose one at least"),
        ({}, "steps: a list of steps is needed"),
        ({**BEGIN, "turns": 0}, "turns = 0: allowed range is above 0 .. 100"),
        ({**BEGIN, "speed": 0.5}, "speed = 0.5: allowed range is 1 .. 60000 r/min"),
        ({**BEGIN, "current": "8"}, "current: a number is needed"),
    ],
)
def test_a_wrong_wish_is_one_line(site, body, words):
    status, answer = site.post("/commission/begin", body)
    assert status == 400 and answer["error"].startswith(words)
    assert course(site) is None


def test_while_it_asks_the_gates_are_off_and_others_are_refused(site):
    site.monitored.dead_man.silent_s = site.monitored.dead_man.hidden_s = 600.0  # there is no page
    assert site.post("/commission/go", {"step": "wiring"})[0] == 400
    site.post("/commission/begin", {**BEGIN, "current": 1e6})
    assert "allowed range is above 0 .. " in ended(site)["problems"][0]
    asked(site)
    plan = course(site)["steps"][0]["plan"]
    assert plan["shaft"].startswith("stands still") and "gates go off at" in plan["current"]
    assert not site.monitored.working()
    for path, body in (
        ("/start", {}), ("/write", {"values": {"rs_ohm": 1}}), ("/parameters/keep", {}),
        ("/commission/begin", BEGIN),
        ("/capture/arm", {"channels": ["vdc_V"], "samples": 9, "pre": 0, "prescaler": 1,
                          "trigger": "command"}),
    ):  # fmt: skip
        status, answer = site.post(path, body)
        assert status == 409 and "a commissioning is under way" in answer["error"], path
    status, answer = site.post("/commission/go", {"step": "rotor"})
    assert status == 400 and "rotor is not the step that waits" in answer["error"]
    assert site.post("/stop", {}) == (200, {})
    assert ended(site)["problems"] == ["stopped by the user"]
    assert "nothing to write" in site.post("/commission/write", {})[1]["error"]
    assert "needs the step rotor" in site.get("/commissioned.toml")[1]["error"]
    asked(site)  # the monitor ends while it asks


def test_wrong_wiring_is_told_as_the_command_tells_it():
    setup = setups.load("paper-a-feasible").changed(sensors__i_wires=[2, 1, 3, 4, -5, 6])
    told = commission(SimulatedDrive(setup), Limits(6.0, 0.1)).mistakes
    choices = {name: choice.initial for name, choice in CHOICES.items()}
    guided = Guided(SimulatedDrive(setup), ["resistance"], 6.0, choices, lambda: None)
    until(lambda: guided.state == "asking")
    guided.go_on("wiring", True)
    guided.join()
    found = guided.described()
    assert len(told) == 3 and found["problems"] == told and found["state"] == "mistakes"
    assert [bool(step.get("pictures")) for step in found["steps"]] == [True, False]
    assert found["values"] == [] and not found["setup"]


def test_a_halted_drive_does_nothing_but_end():
    sim = SimulatedDrive(setups.load("paper-b"))
    drive = Stoppable(sim)
    drive.start()
    drive.run(0.01, record=False)
    drive.halted = "why"
    for work in (
        drive.start, drive.check, lambda: drive.run(1.0), lambda: drive.capture(("vdc_V",), 9),
        lambda: drive.captured(1.0),
    ):  # fmt: skip
        with pytest.raises(CommissioningError, match="why"):
            work()
    drive.stop()
    drive.set_many({"rs_ohm": 1.0})
    assert sim.state == "idle" and sim.get("rs_ohm") == 1.0
