"""The emulated ePWM is compared with a counter that is clocked count by count and knows only the
hardware's rules: when shadow registers load, which action has priority, how long the dead band
delays a switch, and what a trip does. Register writes of any kind come at any count. Both ways to
encode a leg's pattern are compared with the pattern itself.
"""

import itertools
import random
from itertools import groupby

import numpy as np
import pytest
from campaigns import part
from plant_calls import pwm_segment

from hexatorque import firmware, setups
from hexatorque.drive.parts import pwm_map
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.plant.pwm import MAX_EDGES, NEVER, pwm_record

LOW, HIGH, OFF = 0, 1, 2
MIN_PULSE = 5
#: Word offsets from TI's manuals; AQCTL exists on type 4 only.
REGISTERS = {
    "f28335": {
        "BASE": 0x6800, "STRIDE": 0x40, "TBPRD": 0x05, "CMPCTL": 0x07, "CMPA": 0x09,
        "CMPB": 0x0A, "AQCTLA": 0x0B, "AQSFRC": 0x0D, "DBCTL": 0x0F, "DBRED": 0x10,
        "DBFED": 0x11, "TZCTL": 0x14, "TZFLG": 0x16,
    },
    "f28377s": {
        "BASE": 0x4000, "STRIDE": 0x100, "TBPRD": 0x63, "CMPCTL": 0x08, "CMPA": 0x6B,
        "CMPB": 0x6D, "AQCTL": 0x10, "AQCTLA": 0x40, "AQSFRC": 0x47, "DBCTL": 0x0C,
        "DBRED": 0x51, "DBFED": 0x53, "TZCTL": 0x84, "TZFLG": 0x93,
    },
}  # fmt: skip
#: For drivers that switch on with a high pin: output B is inverted, and a trip forces both low.
ACTIVE_HIGH = {"DBCTL": 0x000B, "TZCTL": 0x000A}
#: For drivers that switch on with a low pin: output A is inverted, and a trip forces both high.
ACTIVE_LOW = {"DBCTL": 0x0007, "TZCTL": 0x0005}
SHADOW_AQ = 0x10
IMMEDIATE = 0x50
OTSFA, OST = 4, 4


class Counter:
    """One module, clocked count by count. Its registers are a dictionary, which the test writes."""

    def __init__(self, reg):
        self.reg = reg
        self.a = self.b = 0xFFFF
        self.aq = 0
        self.level = 0
        self.jumps = 0
        self.since = 10**9  # clocks since the last edge before the dead band
        self.state, self.lasts = OFF, 0  # the leg's state, and for how many clocks
        self.pulses = []  # clocks for which a switch was on, until it was told to go off

    def _load(self, event):
        """event 0: counter zero, 1: counter at period."""
        modes = (event, 2)  # 2: both, 3: frozen
        if self.reg["CMPCTL"] & 3 in modes:
            self.a = self.reg["CMPA"]
        if self.reg["CMPCTL"] >> 2 & 3 in modes:
            self.b = self.reg["CMPB"]
        if self.reg.get("AQCTL", 0) & 3 in modes:
            self.aq = self.reg["AQCTLA"]

    def clock(self, count):
        """The leg's state during this count."""
        reg = self.reg
        if count == 0:
            self._load(0)
        if reg["CMPCTL"] & 0x10:
            self.a = reg["CMPA"]
        if reg["CMPCTL"] & 0x40:
            self.b = reg["CMPB"]
        if not reg.get("AQCTL", 0) & SHADOW_AQ:
            self.aq = reg["AQCTLA"]
        # The highest priority comes first. "Do nothing" passes on to the next one.
        wanted = [
            (bool(reg["AQSFRC"] & OTSFA), reg["AQSFRC"] & 3),
            (count == reg["TBPRD"], self.aq >> 2 & 3),
            (count == self.b, self.aq >> 8 & 3),
            (count == self.a, self.aq >> 4 & 3),
            (count == 0, self.aq & 3),
        ]
        reg["AQSFRC"] &= ~OTSFA  # one shot
        action = next((act for event, act in wanted if event and act), 0)
        level = (self.level, 0, 1, 1 - self.level)[action]
        self.since += 1
        if level != self.level:
            self.level, self.since = level, 0
            self.jumps += not reg["TZFLG"] & OST
        if count == reg["TBPRD"]:
            self._load(1)
        off = reg["TZFLG"] & OST or self.since < reg["DBRED" if level else "DBFED"]
        state = OFF if off else (HIGH if level else LOW)
        if state != self.state:
            if self.state != OFF and not reg["TZFLG"] & OST:
                self.pulses.append(self.lasts)
            self.state, self.lasts = state, 0
        self.lasts += 1
        return state

    def pins(self):
        """Levels of outputs A and B in the count just clocked: A is the signal with its rise
        delayed, B with its fall delayed; POLSEL inverts either (DBCTL bit 2: A, 3: B). A trip
        forces 1: high, 2: low (TZCTL bits 1-0: A, 3-2: B)."""
        reg = self.reg
        if reg["TZFLG"] & OST:
            return tuple({1: 1, 2: 0}[reg["TZCTL"] >> shift & 3] for shift in (0, 2))
        rise = self.level == 1 and self.since >= reg["DBRED"]
        fall = self.level == 1 or self.since < reg["DBFED"]
        return int(rise) ^ reg["DBCTL"] >> 2 & 1, int(fall) ^ reg["DBCTL"] >> 3 & 1


class Emulation:
    """pwm_segment, with its edges converted into a waveform."""

    def __init__(self, device, active_low=False):
        self.map = pwm_map(getattr(firmware.lib, f"ht_{device}"), active_low)
        self.map.min_pulse = MIN_PULSE
        self.offsets = REGISTERS[device]
        self.regs = np.zeros(0x8000, np.uint16)
        self.record = pwm_record()
        self.state = [OFF] * 6
        self.wave = [[] for _ in range(6)]

    def address(self, leg, name):
        return self.offsets["BASE"] + leg * self.offsets["STRIDE"] + self.offsets[name]

    def write(self, leg, name, value):
        self.regs[self.address(leg, name)] = value

    def read(self, leg, name):
        return int(self.regs[self.address(leg, name)])

    def play(self, edges, start, stop):
        edges = list(edges)
        assert edges == sorted(edges, key=lambda e: e[0])
        for count in range(start, stop):
            while edges and edges[0][0] == count:
                _, leg, state = edges.pop(0)
                self.state[leg] = state
            for leg in range(6):
                self.wave[leg].append(self.state[leg])
        assert not edges  # none outside its segment

    def segment(self, start, stop, n=0):
        n = pwm_segment(self.map, self.regs, self.record, start, stop, n)
        assert n <= MAX_EDGES
        return n

    def edges(self, n):
        r = self.record
        return zip(*(map(int, column[:n]) for column in (r.count, r.leg, r.state)))


def random_writes(rng, device, prd):
    """Values for a random choice of one module's registers, but never for the period."""
    compare = [0, 1, prd - 1, prd, prd + 1, 65535, rng.randint(0, prd), rng.randint(0, prd)]
    a = rng.choice(compare)
    values = {
        "CMPA": a,
        "CMPB": rng.choice([*compare, a, a]),
        "AQCTLA": rng.choice([0x0331, 0x0332, 0x0330, 0x0121, rng.randrange(0x1000)]),
        "CMPCTL": rng.choice([0, 0, IMMEDIATE, 0x10, 0x40, rng.randrange(16)]),
        "AQSFRC": rng.choice([0, rng.randrange(8), OTSFA | rng.randrange(4)]),
        "TZFLG": rng.choice([0, 0, 0, OST | 1, 1]),
    }
    if device == "f28377s":
        values["AQCTL"] = rng.choice([0, SHADOW_AQ, SHADOW_AQ | 1, rng.randrange(32)])
    share = rng.choice([0.1, 0.4, 1.0])
    return {name: value for name, value in values.items() if rng.random() < share}


def random_run(device, seed, periods=6, active_low=False):
    """(emulated, counted) waveforms of six legs, and the run's dead bands. The counted ones
    are (leg's state, levels of its pins)."""
    rng = random.Random(f"{device}{seed}")
    prd = rng.choice([7, 8, 12, 23, 60])
    pwm = Emulation(device, active_low)
    counters = []
    for leg in range(6):
        dead = [0, 0, 1, 2, prd // 3, prd, prd + 1, 3 * prd]
        reg = {name: 0 for name in REGISTERS[device] if name not in ("BASE", "STRIDE")}
        both = rng.choice(dead)
        reg |= ACTIVE_LOW if active_low else ACTIVE_HIGH
        reg |= {"TBPRD": prd, "DBRED": both, "DBFED": rng.choice([both, both, rng.choice(dead)])}
        counters.append(Counter(reg))
        for name, value in reg.items():
            pwm.write(leg, name, value)
    truth = [[] for _ in range(6)]
    for _ in range(periods):
        cuts = sorted(rng.sample(range(1, prd), rng.randint(0, 4)) + rng.choice([[], [prd]]))
        begin, n = 0, 0
        for at, stop in itertools.pairwise([0, *cuts, prd + 1]):
            if at > 0 and rng.random() < 0.2:  # a segment of no counts does nothing
                n = pwm.segment(at, at, n)
            for leg, counter in enumerate(counters):
                for name, value in random_writes(rng, device, prd).items():
                    counter.reg[name] = value
                    pwm.write(leg, name, value)
            n = pwm.segment(at, stop, n)
            if n > 12 or stop > prd or rng.random() < 0.5:  # else append to these edges
                pwm.play(pwm.edges(n), begin, stop)
                begin, n = stop, 0
            for leg, counter in enumerate(counters):
                truth[leg] += [(counter.clock(count), counter.pins()) for count in range(at, stop)]
    for leg, counter in enumerate(counters):
        assert pwm.record.transitions[leg] == counter.jumps
        assert pwm.record.shortest[leg] == min(counter.pulses, default=NEVER)
        assert pwm.record.short_pulses[leg] == sum(p < MIN_PULSE for p in counter.pulses)
        assert pwm.read(leg, "AQSFRC") & OTSFA == 0
    assert not pwm.record.shorts.any()
    return pwm.wave, truth, [c.reg for c in counters]


@pytest.mark.parametrize("device", REGISTERS)
@pytest.mark.parametrize("block", range(6))
def test_the_emulation_agrees_at_every_count_of_random_writes(device, block):
    for seed in part(range(block * 100, block * 100 + 100), 10):
        wave, truth, _ = random_run(device, seed)
        assert wave == [[state for state, _ in leg] for leg in truth], f"seed {seed}"


@pytest.mark.parametrize("active_low", (False, True))
@pytest.mark.parametrize("device", REGISTERS)
def test_off_is_the_level_that_the_gate_drivers_take_as_off(device, active_low):
    """In the dead time and in a trip both pins have the level for "off". The other level is
    "on"."""
    off = int(active_low)
    pins_of = {OFF: (off, off), HIGH: (1 - off, off), LOW: (off, 1 - off)}
    seen = set()
    for seed in range(2000, 2060):
        wave, truth, _ = random_run(device, seed, active_low=active_low)
        for emulated, counted in zip(wave, truth, strict=True):
            for state, (_, pins) in zip(emulated, counted, strict=True):
                assert pins == pins_of[state]
                seen.add(state)
    assert seen == {LOW, HIGH, OFF}


@pytest.mark.parametrize("active_low", (False, True))
@pytest.mark.parametrize("tzctl", (0b0000, 0b1111))
@pytest.mark.parametrize("device", REGISTERS)
def test_pins_that_a_trip_leaves_free_are_pulled_to_off(device, tzctl, active_low):
    registers = dict(ACTIVE_LOW if active_low else ACTIVE_HIGH, TZCTL=tzctl)
    prd = 40
    pwm = start(device, prd, 5, active_low=active_low, AQCTLA=0x0121, CMPA=10, CMPB=30, **registers)
    run_period(pwm, prd, 20, {})
    run_period(pwm, prd, 20, {0: {"TZFLG": OST}})
    assert pwm.record.gate[0] == OFF and pwm.record.gate[1] != OFF
    assert pwm.record.shorts[0] == 0


@pytest.mark.parametrize("wrong", ("drivers", "dead band", "trip"))
@pytest.mark.parametrize("device", REGISTERS)
def test_wrong_polarity_is_both_switches_on(device, wrong):
    """The registers are for one polarity of the gate drivers, and the drivers have the other."""
    registers = dict(ACTIVE_HIGH if wrong == "drivers" else ACTIVE_LOW)
    if wrong == "dead band":
        registers["DBCTL"] = ACTIVE_HIGH["DBCTL"]
    elif wrong == "trip":
        registers["TZCTL"] = ACTIVE_HIGH["TZCTL"]
    prd = 40
    pwm = start(device, prd, 5, active_low=True, AQCTLA=0x0121, CMPA=10, CMPB=30, **registers)
    run_period(pwm, prd, 20, {})
    run_period(pwm, prd, 20, {0: {"TZFLG": OST}})
    assert pwm.record.shorts[0] > 0


@pytest.mark.parametrize("device", REGISTERS)
def test_dead_time_between_the_two_switches(device):
    crossings = 0
    for seed in range(1000, 1150):
        wave, _, regs = random_run(device, seed)
        for states, reg in zip(wave, regs):
            runs = [(state, len(list(group))) for state, group in groupby(states)]
            for (a, _), (b, length), (c, _) in zip(runs, runs[1:], runs[2:]):
                if b == OFF and {a, c} == {LOW, HIGH}:
                    crossings += 1
                    assert length >= reg["DBRED" if c == HIGH else "DBFED"]
            for (a, _), (b, _) in itertools.pairwise(runs):
                if {a, b} == {LOW, HIGH}:
                    assert reg["DBRED" if b == HIGH else "DBFED"] == 0
    assert crossings > 1000


def start(device, prd, dead=0, active_low=False, **registers):
    pwm = Emulation(device, active_low)
    common = {"TBPRD": prd, "DBRED": dead, "DBFED": dead, "CMPA": 65535, "CMPB": 65535}
    common |= ACTIVE_HIGH
    for leg, (name, value) in itertools.product(range(6), (common | registers).items()):
        pwm.write(leg, name, value)
    return pwm


def run_period(pwm, prd, write_at, writes):
    """Run one period in which `writes` {leg: {register: value}} arrive at a count."""
    n = pwm.segment(0, write_at)
    for leg, values in writes.items():
        for name, value in values.items():
            pwm.write(leg, name, value)
    n = pwm.segment(write_at, prd + 1, n)
    pwm.play(pwm.edges(n), 0, prd + 1)


def toggling(s, t1, t2, never):
    """Encoding 1: the start level at ZERO, and a toggle at each change of level."""
    return {
        "AQCTLA": 0x0330 | (2 if s[0] else 1),
        "CMPA": t1 if s[0] != s[1] else never,
        "CMPB": t2 if s[1] != s[2] else never,
    }


def fixed_actions(s, t1, t2, never):
    """Encoding 2: ZERO clears, CMPA sets, CMPB clears, always."""
    a, b = {
        (0, 0, 0): (never, never), (1, 1, 1): (0, never), (0, 1, 0): (t1, t2),
        (0, 1, 1): (t1, never), (0, 0, 1): (t2, never), (1, 0, 0): (0, t1), (1, 1, 0): (0, t2),
    }[s]  # fmt: skip
    return {"CMPA": a, "CMPB": b}


@pytest.mark.parametrize("device", REGISTERS)
@pytest.mark.parametrize("prd", [7, 41])
def test_encodings_give_the_pattern_in_the_next_period(device, prd):
    rng = random.Random(prd)
    # Type 4 takes the start level over at the period, type 0 from the write on.
    shadow_aq = {"AQCTL": SHADOW_AQ | 1} if device == "f28377s" else {}
    one = start(device, prd, AQCTLA=0x0331, **shadow_aq)
    two = start(device, prd, AQCTLA=0x0121)
    levels = [s for s in itertools.product((0, 1), repeat=3) if s != (1, 0, 1)]
    expected = [[] for _ in range(6)]
    for leg in range(6):
        expected[leg] += [0] * (prd + 1)  # the period in which the first pattern is written
    for last in [False] * 60 + [True]:
        write_at = rng.randint(1, prd)
        patterns = [
            (rng.choice(levels), *sorted(rng.sample(range(1, prd + 1), 2))) for _ in range(6)
        ]
        run_period(one, prd, write_at, {i: toggling(*p, prd + 1) for i, p in enumerate(patterns)})
        run_period(
            two, prd, write_at, {i: fixed_actions(*p, prd + 1) for i, p in enumerate(patterns)}
        )
        if not last:
            for leg, (s, t1, t2) in enumerate(patterns):
                expected[leg] += [s[(c >= t1) + (c >= t2)] for c in range(prd + 1)]
    assert one.wave == expected
    assert two.wave == expected


@pytest.mark.parametrize("device", REGISTERS)
def test_only_encoding_1_gives_a_gap(device):
    prd = 30
    shadow_aq = {"AQCTL": SHADOW_AQ | 1} if device == "f28377s" else {}
    pwm = start(device, prd, AQCTLA=0x0331, **shadow_aq)
    run_period(pwm, prd, 5, {2: toggling((1, 0, 1), 9, 20, prd + 1)})
    run_period(pwm, prd, 5, {})
    assert pwm.wave[2][prd + 1 :] == [1] * 9 + [0] * 11 + [1] * 11


@pytest.mark.parametrize("device", REGISTERS)
@pytest.mark.parametrize("dead", [0, 3, 5])
def test_a_pulse_shorter_than_the_dead_band_disappears(device, dead):
    prd = 40
    pwm = start(device, prd, dead, AQCTLA=0x0121, CMPA=10, CMPB=14)
    run_period(pwm, prd, 20, {})
    high = [LOW] * 10 + [OFF] * dead + [HIGH] * (4 - dead) + [OFF] * dead
    swallowed = [LOW] * 10 + [OFF] * (4 + dead)
    wave = swallowed if dead > 4 else high
    assert pwm.wave[0] == wave + [LOW] * (prd + 1 - len(wave))


@pytest.mark.parametrize("device", REGISTERS)
def test_dead_band_runs_across_the_period_and_through_a_trip(device):
    prd = 20
    pwm = start(device, prd, 6, AQCTLA=0x0030, CMPA=17)  # toggles at 17
    run_period(pwm, prd, 5, {})
    run_period(pwm, prd, 10, {3: {"TZFLG": OST}})
    run_period(pwm, prd, 1, {3: {"TZFLG": 0}})
    run = pwm.wave[0]
    assert run == ([LOW] * 17 + [OFF] * 6 + [HIGH] * 15 + [OFF] * 6 + [LOW] * 15 + [OFF] * 4)
    # Tripped from count 31 to 43, the leg stays off until the dead band that began at 38 is over.
    assert pwm.wave[3] == run[:31] + [OFF] * 13 + run[44:]


@pytest.mark.parametrize("device", REGISTERS)
def test_a_segment_of_no_counts_leaves_everything_to_the_next(device):
    prd = 10
    writes = {"AQSFRC": OTSFA | 2, "TZFLG": OST}
    for name, value in writes.items():
        pwm = start(device, prd)
        run_period(pwm, prd, 4, {})
        pwm.write(1, name, value)
        assert pwm.segment(0, 0) == 0
        run_period(pwm, prd, 4, {})
        assert pwm.wave[1][prd + 1 :] == [HIGH if name == "AQSFRC" else OFF] * (prd + 1)


@pytest.mark.parametrize("device", REGISTERS)
def test_actions_at_one_count_follow_their_priorities(device):
    """All actions are at one count. Each one takes effect if those of higher priority are
    removed."""
    prd, count = 7, 7
    fields = {"ZERO": 0, "PRD": 2, "CAU": 4, "CBU": 8}
    for losers in (["CAU"], ["CAU", "CBU"], ["CAU", "CBU", "PRD"]):
        winner = losers[-1]
        actions = sum(1 << fields[name] for name in losers) ^ (3 << fields[winner])
        pwm = start(device, prd, CMPCTL=IMMEDIATE, CMPA=count, CMPB=count, AQCTLA=actions)
        run_period(pwm, prd, 3, {})
        assert pwm.wave[0] == [0] * 7 + [1], winner
    everything = start(device, prd, CMPCTL=IMMEDIATE, CMPA=0, CMPB=0, AQCTLA=0x0111)
    run_period(everything, prd, 0, {0: {"AQSFRC": OTSFA | 2}, 1: {"AQCTLA": 0x0211},
                                    2: {"AQCTLA": 0x0021}, 3: {"AQCTLA": 0x0002}})  # fmt: skip
    assert [everything.wave[leg][0] for leg in range(5)] == [1, 1, 1, 1, 0]


class Watched:
    """A drive, and a counter for each leg that gets what the firmware writes, at the count at
    which it writes."""

    def __init__(self, setup):
        self.sim = SimulatedDrive(setup, 1)
        self.words = self.sim.controller.register_words()
        self.offsets = REGISTERS[setup["timing.device"]]
        self.names = [name for name in self.offsets if name not in ("BASE", "STRIDE")]
        self.counters = [Counter(self.written(leg)) for leg in range(6)]

    def written(self, leg):
        at = self.offsets["BASE"] + leg * self.offsets["STRIDE"]
        return {name: int(self.words[at + self.offsets[name]]) for name in self.names}

    def intended(self):
        """Level of each leg in every count of the next period, as the law told the observer."""
        state = self.sim.controller.drive.control
        counts = int(self.sim._timing.period)
        first, last = (
            np.array([word >> (5 - leg) & 1 for leg in range(6)])
            for word in (state.next.s[0], state.next.s[1])
        )
        toggles = state.toggles[state.next.own - 1]
        at = [round(toggles.t[leg] * counts) for leg in range(6)]
        return [[a] * n + [b] * (counts - n) for a, b, n in zip(first, last, at)]

    def period(self):
        """(levels, legs' states) that the counters have, and the states of the logged edges."""
        timing = self.sim._timing
        begin, counts = self.sim.periods * int(timing.period), int(timing.period)
        for leg, counter in enumerate(self.counters):
            counter.reg = self.written(leg)
        levels, states = [[] for _ in range(6)], [[] for _ in range(6)]

        def clock(start, stop):
            for leg, counter in enumerate(self.counters):
                for count in range(start, stop):
                    states[leg].append(counter.clock(count))
                    levels[leg].append(counter.level)

        clock(0, int(timing.write_count))
        self.sim.log_edges(200)
        legs = [int(state) for state in self.sim.inverter.leg]
        self.sim.run(self.sim.period_s, record=False)
        for leg, counter in enumerate(self.counters):
            counter.reg |= self.written(leg)
        clock(int(timing.write_count), counts)
        told = [[state] * counts for state in legs]
        for count, leg, state in self.sim.edges.tolist():
            told[leg][count - begin :] = [state] * (counts - (count - begin))
        return levels, states, told


@pytest.mark.parametrize(("share", "periods"), ((0.0, 8), (0.5, 256), (1.0, 8)))
@pytest.mark.parametrize("device", REGISTERS)
def test_the_edges_of_interleaved_carriers_are_those_of_a_counter(device, share, periods):
    """At four times its switching frequency, at a voltage at which pulses have places of their own,
    or both sets begin together, or set 2 joins set 1 and leaves it: what the law decides in one
    period the counter makes in the next one, and the emulation has the same edges behind the dead
    band."""
    watched = Watched(
        setups.load("paper-b").with_scheme(
            "db-ipwm", timing__device=device, timing__latency="predicted",
            controller__f_isr_Hz=40000.0, controller__thd_share=share,
        )
    )  # fmt: skip
    sim = watched.sim
    sim.start()
    sim.run(0.45, record=False)
    sim.set("speed_ref_rpm", 2000.0)
    sim.run(0.6, record=False)
    for _ in range(2):  # from their end on the counters know levels and dead bands
        watched.period()
    toggles = 0
    for _ in range(periods):
        intended = watched.intended()
        levels, states, told = watched.period()
        assert levels == intended
        assert states == told
        inside = [len(list(groupby(leg))) - 1 for leg in levels]
        assert max(inside) <= 1
        toggles += sum(inside)
    # Three a period are one of each leg in two. Some lie at a period's begin, and where a set
    # that begins together with the other takes another sense, three of its legs toggle in a row.
    assert abs(toggles - 3 * periods) <= 4 * periods / 8
    assert sim.faults == [] and sim.controller.registers.violations == 0
