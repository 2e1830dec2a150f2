"""A virtual board's power stage can pull the trip pin: for a moment, or until it is released."""

import pytest

from hexatorque import setups
from hexatorque.boards import virtual
from hexatorque.cli.main import main
from hexatorque.firmware import FirmwareError, lib

SETUP = setups.load("paper-a-feasible")


@pytest.fixture
def board():
    with virtual.VirtualBoard(SETUP) as made:
        yield made


@pytest.mark.parametrize("turn_s", (0.002, 0.05))
def test_a_short_pull_trips_at_its_time_however_long_a_turn_is(board, turn_s):
    board.pull_trip_pin(0.1)
    board.sim.start()
    while board._ran_s < 0.15:
        board.run(turn_s)
    assert board.sim.state == "fault" and board.sim.faults == ["external trip"]
    assert board.sim.trip.time_s == pytest.approx(0.1, abs=2e-4)
    board.sim.clear()  # the pin is high again
    assert board.sim.state == "idle"


def test_a_long_pull_refuses_a_clear_until_it_ends(board):
    board.run(0.01)
    board.pull_trip_pin(0.05, 0.2)
    board.sim.start()
    board.run(0.1)
    assert board.sim.faults == ["external trip"]
    with pytest.raises(FirmwareError, match="the trip pin is low"):
        board.sim.clear()
    board.run(0.2)
    board.sim.clear()
    assert board.sim.state == "idle"


def test_the_command_passes_it_on(monkeypatch, capsys):
    seen = []

    def serve(board, line, until, record, xcp):
        board.sim.start()
        for _ in range(8):
            board.run(0.1)
            low = lib.ht_port_trip_pin_low(board.sim.controller.port)
            seen.append((board.sim.state, bool(low)))

    monkeypatch.setattr(virtual, "serve", serve)
    assert main(["board", "serve", "--trip-pin", "0.15", "--trip-pin", "0.35+0.3"]) == 0
    capsys.readouterr()
    assert [state for state, _ in seen] == ["build", *["fault"] * 7]
    assert [low for _, low in seen] == [False] * 3 + [True] * 3 + [False] * 2
