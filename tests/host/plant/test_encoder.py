"""The emulated capture unit is compared with one that steps through every edge and every tick of
the capture clock, as the chip does. It has a 16-bit timer, which a unit event (every fourth edge in
either direction) copies to QCPRD and sets to zero, and sticky flags.
"""

from types import SimpleNamespace

import numpy as np
import pytest
from plant_calls import sample

from hexatorque import firmware, setups
from hexatorque.drive import parts
from hexatorque.plant.machines.induction import Parameters, make

EQEP = {"f28335": 0x6B00, "f28377s": 0x5100}
QPOSILAT, QEPCTL, QCAPCTL, QFLG, QEPSTS, QCTMR, QCPRD = 0x08, 0x15, 0x16, 0x19, 0x1C, 0x1D, 0x1E
UPEVNT, QDF, COEF, CDEF = 0x80, 0x20, 0x08, 0x04
#: Capture clocks between two samples at 10 kHz: SYSCLKOUT of 150 and 200 MHz, divided by 128.
TICKS = {"f28335": 150e6 / 128 * 1e-4, "f28377s": 200e6 / 128 * 1e-4}
PPR = 2048
MACHINE = make(Parameters(2, 1.0, 1.0, 10e-3, 10e-3, 1e-9, 10e-3, 1.0))


class Emulated:
    """The plant's sensors, with a position that the test sets."""

    def __init__(self, device, **sensors):
        setup = setups.load("paper-b").changed(
            sensors__encoder_ppr=PPR, **{f"sensors__{k}": v for k, v in sensors.items()}
        )
        layout = getattr(firmware.lib, f"ht_{device}")
        board = SimpleNamespace(slow_channel=(6, 7))
        chip = SimpleNamespace(map=layout, port=SimpleNamespace(eqep=layout.eqep, board=board))
        self._sensors = parts.sensors(setup, chip, 1e-4)
        self.regs = np.zeros(0x8000, np.uint16)
        self._base = EQEP[device]
        self.regs[self._base + QCAPCTL] = 0x8000 | 7 << 4 | 2
        self._y = np.zeros(8)

    def turn(self, counts):
        self._y[7] = counts / (4 * PPR) * 2 * np.pi
        sample(self._sensors, MACHINE, self._y, 0.0, self.regs)

    def read(self, clear=False):
        """Counter, timer, period and status; `clear` as the firmware does."""
        words = [int(self.regs[self._base + n]) for n in (0, 1, QCTMR, QCPRD, QEPSTS)]
        if clear:
            self.regs[self._base + QEPSTS] &= QDF
        return (words[0] + (words[1] << 16), *words[2:])


class Stepped:
    """A capture unit that steps edge by edge and tick by tick. `channel_b`: how late channel B
    rises and how early it falls."""

    def __init__(self, ticks_per_sample, channel_b=0.0):
        shift = {0: 0.0, 1: channel_b, 2: 0.0, 3: -channel_b}
        self._place = lambda edge: edge + shift[edge % 4]
        self._per_sample = ticks_per_sample
        self._sample, self._x = 0, 0.0
        self.counter, self.timer, self.period, self.status = 0, 0, 0, 0
        self._edges = 0
        self.index_at, self.latched = None, None

    def _edge(self, direction):
        self.counter += direction
        if self.index_at is not None and (self.counter - self.index_at) % (4 * PPR) == 0:
            self.latched = self.counter % 2**32
        if (direction > 0) != bool(self.status & QDF):
            self.status = (self.status ^ QDF) | CDEF
        self._edges += 1
        if self._edges == 4:
            self._edges = 0
            self.period, self.timer = self.timer, 0
            self.status |= UPEVNT

    def _move(self, x):
        while self._place(self.counter + 1) <= x:
            self._edge(1)
        while self._place(self.counter) > x:
            self._edge(-1)

    def turn(self, counts):
        begin, end = self._sample * self._per_sample, (self._sample + 1) * self._per_sample
        for tick in range(int(begin) + 1, int(end) + 1):
            self._move(self._x + (counts - self._x) * (tick - begin) / (end - begin))
            self.timer += 1
            if self.timer == 65536:
                self.timer = 0
                self.status |= COEF
        self._move(counts)
        self._sample, self._x = self._sample + 1, counts

    def read(self, clear=False):
        seen = (self.counter % 2**32, self.timer, self.period, self.status)
        if clear:
            self.status &= QDF
        return seen


def wander(rng):
    """A slow path that often passes zero."""
    return np.cumsum(0.2 * np.sin(np.arange(1500) / 70) + rng.normal(0, 0.05, 1500))


def fast(rng):
    """Up to 6000 r/min in both directions, which is 82 edges between two samples."""
    return np.cumsum(82 * np.sin(np.arange(300) / 40) + rng.normal(0, 1, 300))


def halting(rng):
    """Movements, with pauses in between that are longer than the timer's range."""
    moves = [rng.normal(0, 1) * np.linspace(0, 20, 40) for _ in range(3)]
    pieces = [np.concatenate([m, np.full(int(rng.integers(500, 900)), m[-1])]) for m in moves]
    starts = np.cumsum([0, *(p[-1] for p in pieces[:-1])])
    return np.concatenate([p + s for p, s in zip(pieces, starts)])


@pytest.mark.parametrize("channel_b", [0.0, 0.08])
@pytest.mark.parametrize("path", [wander, fast, halting])
@pytest.mark.parametrize("device", EQEP)
def test_the_capture_unit_agrees_at_every_edge(device, path, channel_b):
    rng = np.random.default_rng(7)
    emulated = Emulated(device, encoder_error_cycles=channel_b)
    stepped = Stepped(TICKS[device], 4 * channel_b)
    positions = path(rng) + 0.37
    flags = 0
    for x in positions:
        emulated.turn(x)
        stepped.turn(x)
        clear = rng.random() < 0.05
        expected = stepped.read(clear)
        assert emulated.read(clear) == expected
        flags |= expected[3]
    wanted = {wander: UPEVNT | CDEF | QDF, fast: UPEVNT | CDEF | QDF, halting: UPEVNT | COEF}
    assert flags & wanted[path] == wanted[path]  # the path has set its flags


@pytest.mark.parametrize("index_deg", [0.1, 90.0, 359.9, 360.0])
@pytest.mark.parametrize("path", [wander, fast, halting])
@pytest.mark.parametrize("device", EQEP)
def test_the_index_latches_the_counter_at_every_rise(device, path, index_deg):
    """The counter itself goes on. Paths that pass the index often, from both sides."""
    emulated = Emulated(device, encoder_index_deg=index_deg)
    stepped = Stepped(TICKS[device])
    stepped.index_at = round(index_deg / 360 * 4 * PPR)
    base, regs = EQEP[device], emulated.regs
    regs[base + QEPCTL] = 0x10
    positions = path(np.random.default_rng(7))
    around = stepped.index_at if 0.1 < index_deg < 359 else 0
    found = 0
    for x in np.linspace(0, around, 3 if around else 1).tolist() + (positions + around).tolist():
        emulated.turn(x)
        stepped.turn(x)
        assert emulated.read() == stepped.read()
        assert bool(regs[base + QFLG] & 0x0400) == (stepped.latched is not None)
        if stepped.latched is not None:
            assert (
                int(regs[base + QPOSILAT]) | int(regs[base + QPOSILAT + 1]) << 16 == stepped.latched
            )
            found += 1
        regs[base + QFLG], stepped.latched = 0, None
    assert found or index_deg < 1 or index_deg > 359


def test_no_index_latches_unless_the_driver_asks_for_it():
    for control, index_deg in ((0x00, 10.0), (0x20, 10.0), (0x10, 0.0)):
        emulated = Emulated("f28335", encoder_index_deg=index_deg)
        emulated.regs[EQEP["f28335"] + QEPCTL] = control
        emulated.turn(3 * 4 * PPR)
        assert not emulated.regs[EQEP["f28335"] + QFLG]


@pytest.mark.parametrize(("share", "overflow"), [(-0.05, False), (0.05, True)])
@pytest.mark.parametrize("device", EQEP)
def test_an_overflow_shows_only_if_the_timer_ends_before_the_event(device, share, overflow):
    """Edge 4 is passed in the first sample. Edge 8, the next unit event, is passed in the sample in
    which the timer ends, a little before or after its end."""
    end = 4 / 4.5 + 65536 / TICKS[device]
    last = int(end)
    x = 4.5 + (8 - 4.5) / (end + share - last)
    emulated, stepped = Emulated(device), Stepped(TICKS[device])
    for n in range(last + 1):
        for unit in emulated, stepped:
            unit.turn(4.5 if n < last else x)
    assert emulated.read() == stepped.read()
    assert bool(stepped.read()[3] & COEF) == overflow


def test_the_period_at_constant_speed_is_four_counts():
    """At 1 count in 1 ms, four counts take 4 ms or 4687.5 ticks. The timer runs from the last
    event."""
    emulated = Emulated("f28335")
    for n in range(1, 201):  # 20 ms; edges at 1, 2, ... ms
        emulated.turn(0.1 * n - 1e-6)
    counter, timer, period, status = emulated.read()
    assert counter == 19
    assert period in (4687, 4688)
    assert timer == pytest.approx(4 * 1171.875, abs=1.5)  # last event at 16 ms
    assert status == UPEVNT | QDF | CDEF  # CDEF: the first edge, after reset


def test_nothing_is_captured_while_off():
    emulated = Emulated("f28335")
    emulated.regs[EQEP["f28335"] + QCAPCTL] = 0x0072
    for n in range(50):
        emulated.turn(1.7 * n)
    assert emulated.read() == (83, 0, 0, 0)


def test_prescalers_are_taken_from_the_register():
    """With SYSCLKOUT / 2 and an event at every edge, 0.1 ms between two edges are 7500 ticks."""
    emulated = Emulated("f28335")
    emulated.regs[EQEP["f28335"] + QCAPCTL] = 0x8010
    for n in range(10):
        emulated.turn(n + 0.5)
    assert emulated.read()[1:3] == (3750, 7500)


def test_unequal_edges_are_counted_where_they_are():
    """Channel B rises 0.2 counts late and falls 0.2 counts early. The counter must follow."""
    emulated = Emulated("f28335", encoder_error_cycles=0.05)
    shown = []
    for x in (0.99, 1.1, 1.19, 1.21, 1.99, 2.01, 2.79, 2.81, 3.99, 4.01):
        emulated.turn(x)
        shown.append(emulated.read()[0])
    assert shown == [0, 0, 0, 1, 1, 2, 2, 3, 3, 4]


@pytest.mark.parametrize(
    ("encoder_wires", "last"),
    (("straight", {40}), ("swapped", {2**32 - 41}), ("one open", {0, 1, 2**32 - 1}), ("open", {0})),
)
def test_wires_of_the_encoder(encoder_wires, last):
    """The shaft is at 40.5 counts. Swapped channels count down. The edges of an open channel never
    come: up and down again."""
    emulated = Emulated("f28335", encoder_wires=encoder_wires)
    for n in range(41):
        emulated.turn(n + 0.5)
    assert (emulated.read()[0] % 2**32) in last
