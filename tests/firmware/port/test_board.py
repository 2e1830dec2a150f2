"""What the start of a board amounts to: frequencies, times and pins worked out from
the registers that it leaves, with the manuals' formulas and limits.
"""

import re
from pathlib import Path

import pytest

from hexatorque.chips import BOARDS, DEVICES, SOURCES
from hexatorque.firmware import ALL_LEGS, ffi, lib, parameters

DOCS = Path(__file__).resolve().parents[3] / "docs"
CRYSTAL = {"f28335": 30e6, "f28377s": 20e6, "launchxl_f28377s": 10e6}
SYSCLK = {"f28335": 150e6, "f28377s": 200e6, "launchxl_f28377s": 200e6}
#: First register of port A, distance between ports.
GPIO = {"f28335": (0x6F80, 0x10), "f28377s": (0x7C00, 0x40), "launchxl_f28377s": (0x7C00, 0x40)}
SCI = {"f28335": 0x7050, "f28377s": 0x7200, "launchxl_f28377s": 0x7200}
#: Pins without a bond in the F28377S's 100-pin package (data sheet, pin table).
UNBONDED = {0, 1, *range(5, 10), *range(22, 41), *range(44, 58), 67, 68, *range(74, 78),
            *range(79, 84), 88, *range(93, 99)}  # fmt: skip
ASYNC, SYNC, SIX_SAMPLES = 3, 0, 2
#: Crossbars of the F28377S's inputs: fixed pull-downs of 50 kohm, and 100 pF (SPRS881, ADC).
LOADED_INPUTS = {("A", 0), ("A", 1), ("B", 0), ("B", 1)}
#: Inputs that the 100-pin package has and TI's two-motor example uses on the LaunchPad's headers.
LAUNCHPAD_INPUTS = {*(("A", n) for n in range(6)), *(("B", n) for n in range(6)), ("A", 14)}


class Started:
    def __init__(self, board, planted=()):
        self.name = board
        self.board = ffi.addressof(getattr(lib, f"ht_board_{board}"))
        self.rf, self.port = ffi.new("ht_regfile *"), ffi.new("ht_port *")
        lib.ht_regfile_reset(self.rf, self.board.map)
        for name, value in planted:
            setattr(self.rf, name, value)
        lib.ht_port_bind(self.port, self.rf, self.board)
        self.good = lib.ht_board_start(self.port)

    @property
    def small(self):
        return self.name == "f28335"

    def word(self, address):
        return lib.ht_regfile_word(self.rf, address)[0]

    def long(self, address):
        word = lib.ht_regfile_word(self.rf, address)
        return word[0] | word[1] << 16

    def init(self, slow_Hz=100.0):
        assert lib.ht_port_init(self.port, [[10000, 200, True, slow_Hz]])

    def pin(self, gpio):
        """Position of the multiplexer, qualification, pull-up, output."""
        first, stride = GPIO[self.name]
        first += gpio // 32 * stride
        half = first + 2 * (gpio % 32 // 16)
        shift = 2 * (gpio % 16)
        mux = self.long(half + 6) >> shift & 3
        if not self.small:
            mux |= (self.long(half + 0x20) >> shift & 3) << 2
        return (
            mux,
            self.long(half + 2) >> shift & 3,
            not self.long(first + 0xC) >> gpio % 32 & 1,
            bool(self.long(first + 0xA) >> gpio % 32 & 1),
        )


@pytest.fixture(params=BOARDS)
def started(request):
    return Started(request.param)


def test_table_of_chips():
    """The names that Python reads from the table's text are those of the compiled firmware: a
    chip's number, its map, and a board of its own name for whoever knows the number only."""
    assert len(DEVICES) == lib.HT_DEVICES >= 2
    for number, name in enumerate(DEVICES):
        assert getattr(lib, f"HT_DEVICE_{name}") == getattr(lib, f"ht_{name}").device == number
        board = lib.ht_board_of_device(number)
        assert board.map.device == number
        assert ffi.string(board.name).decode() == name
    assert lib.ht_board_of_device(len(DEVICES)) == ffi.NULL


def test_boards_have_the_chip_of_their_row():
    table = (SOURCES / "port/c2000/ht_chips.def").read_text()
    rows = re.findall(r"^HT_CHIP_BOARD\((\w+), (\w+)\)", table, re.M)
    assert [board for _, board in rows] == list(BOARDS)
    for chip, board in rows:
        map_of_board = getattr(lib, f"ht_board_{board}").map
        assert map_of_board.device == getattr(lib, f"HT_DEVICE_{chip}")


def test_no_forbidden_register_access(started):
    assert started.good
    started.init()
    started.init()  # again, as after a change of parameters
    assert started.rf.violations == 0
    assert started.rf.eallow == 0


def test_system_clock(started):
    if started.small:  # PLLCR, PLLSTS.DIVSEL: 2 = half
        assert started.word(0x7011) >> 7 & 3 == 2
        clock = CRYSTAL[started.name] * started.word(0x7021) / 2
    else:  # crystal selected, PLL selected; PLLSYSCLKDIV n > 0 divides by 2 n
        assert (started.long(0x5D208) & 3, started.long(0x5D20E)) == (1, 3)
        raw = CRYSTAL[started.name] * started.long(0x5D214)
        assert 120e6 <= raw <= 400e6
        clock = raw / (2 * started.long(0x5D222))
    assert clock == SYSCLK[started.name] == started.board.map.system_clock_Hz


def test_pwm_clock(started):
    clock = SYSCLK[started.name]
    if not started.small:  # EPWMCLKDIV: at most 100 MHz
        clock /= {0: 1, 1: 2}[started.long(0x5D226) & 3]
        assert clock <= 100e6
        assert started.long(0x5D226) & 0x50 == 0x50  # others' dividers are as they were
    assert clock == started.board.map.pwm_clock_Hz


def test_adc_timing(started):
    """Clock within the data sheet's limit, a sample of 75 ns (F28377S) or more, and all
    seven channels within a few us of each other; no current at an input that loads its source. The
    thermistors come last: on the F28377S when all others are over, or beside the dc link."""
    clock = SYSCLK[started.name]
    if started.small:
        hspclk = clock / (2 * started.word(0x701A))
        adc = hspclk / (2 * (started.word(0x7118) >> 1 & 0xF))
        assert adc <= 25e6
        window = ((started.word(0x7100) >> 8 & 0xF) + 1) / adc
        sequence = 8 * (window + 1 / adc) + 2 / adc
        channels = [started.word(0x7103 + n // 4) >> 4 * (n % 4) & 0xF for n in range(8)]
        assert started.word(0x7102) + 1 == 8
        assert channels == list(range(8))  # A0 ... A6, and the winding's thermistor at A7
    else:
        inputs = {}
        for name, base, conversions in (("A", 0x7400, 5), ("B", 0x7480, 4)):
            ratio = 1 + (started.word(base + 1) & 0xF) / 2  # PRESCALE: 1, (1.5), 2, 2.5, ...
            assert clock / ratio <= 50e6
            assert started.word(base + 1) & 0xC0 == 0  # 12 bits, single-ended
            soc = [started.long(base + 0x10 + 2 * n) for n in range(conversions)]
            assert {s >> 20 for s in soc} == {5}  # ePWM1 SOCA
            window = ((soc[0] & 0x1FF) + 1) / clock
            assert window >= 75e-9
            inputs[name] = [(name, s >> 15 & 0xF) for s in soc]
            assert all(started.long(base + 0x70 + 2 * n) & 0xFFFF == 0 for n in (0, 1, 3, 4))
            assert started.long(base + 0x74) & 0xFFFF != 0
            assert started.word(base + 9) & 0x1F == conversions  # in this order
        sequence = 4 * (window + 41 / clock)  # tEOC at PRESCALE 6
        assert started.word(0x7407) & 0x2F == 0x23  # INT1 at the end of the last
        # u1 w1 v1 and the dc link, u2 w2 v2: where the results are read is the driver's test.
        assert len({*inputs["A"], *inputs["B"]}) == 9
        assert not {*inputs["A"], *inputs["B"]} & LOADED_INPUTS
        assert (inputs["A"][4], inputs["B"][3]) == (("A", 5), ("B", 5))  # thermistors
        assert {*inputs["A"], *inputs["B"]} <= LAUNCHPAD_INPUTS
    assert 1e-6 < sequence < 3e-6


def test_adc_has_time_to_settle(started):
    need_us = 5000 if started.small else 500
    assert started.rf.time_us - started.rf.powered_us >= need_us


@pytest.mark.parametrize("slow_Hz", (10.0, 30.0, 100.0, 125.0, 1000.0))
def test_slow_timer(started, slow_Hz):
    started.init(slow_Hz)
    period = (started.long(0x0C02) + 1) * (1 + started.word(0x0C06)) / SYSCLK[started.name]
    assert 1 / period == pytest.approx(slow_Hz, rel=1e-6)
    assert started.word(0x0C04) == 0x4000  # runs, interrupts


@pytest.mark.parametrize("slow_Hz", (10.0, 30.0, 100.0, 125.0, 1000.0))
def test_watchdog_outlasts_two_slow_periods_and_not_many_more(started, slow_Hz):
    started.init(slow_Hz)
    control = started.word(0x7029)
    assert not control & 0x40  # on
    prescaler = (1, 1, 2, 4, 8, 16, 32, 64)[control & 7]
    timeout = 256 * 512 / (30e6 if started.small else 10e6) * prescaler
    assert timeout * slow_Hz >= 2.5
    assert timeout * slow_Hz < 5.0 or prescaler == 1


BAUDS = (300, 9600, 19200, 57600, 115200, 230400, 460800, 921600, 1250000)


@pytest.mark.parametrize("baud", BAUDS)
def test_nearest_baud_rate(started, baud):
    """LSPCLK / 8 / (BRR + 1): no other BRR gives a nearer rate."""
    lspclk = SYSCLK[started.name] / (
        2 * (started.word(0x701B) if started.small else started.long(0x5D22C))
    )
    assert lspclk <= (75e6 if started.small else 200e6)  # data sheets
    assert lib.ht_sci_start(started.port, baud)
    divider = (started.word(SCI[started.name] + 2) << 8 | started.word(SCI[started.name] + 3)) + 1
    assert abs(divider - lspclk / 8 / baud) <= 0.5
    assert lib.ht_sci_baud(started.port) == pytest.approx(lspclk / 8 / divider, rel=1e-6)
    assert started.rf.violations == 0


def test_the_pages_tell_the_rates_that_the_boards_make(started):
    """A client and its adapter have to know both: what is asked for, and what the clock makes."""
    pages = {name: (DOCS / f"{name}.md").read_text() for name in ("protocol", "first-spin")}
    told = re.search(
        r"([\d.]+) Mbaud on an F28377S; (\d+) baud on an\s+F28335, whose clock makes (\d+) of it, "
        r"([\d.]+) % more", pages["protocol"],
    )  # fmt: skip
    fast, asked, made, percent = map(float, told.groups())
    assert f"{fast:g} Mbaud or {made / 1e3:g} kbaud (F28335)" in pages["first-spin"]
    assert percent == round(100 * (made / asked - 1), 1)
    wanted = (asked, made) if started.small else (1e6 * fast, 1e6 * fast)
    assert lib.ht_sci_start(started.port, started.board.baud)
    assert (started.board.baud, lib.ht_sci_baud(started.port)) == wanted


@pytest.mark.parametrize("baud", (0, 1, 100, 5_000_000, 10_000_000, 2**32 - 1))
def test_impossible_baud_rate_changes_nothing(started, baud):
    before = lib.ht_sci_baud(started.port)
    lspclk = 75e6 if started.small else 50e6
    possible = lspclk / 8 / 65536 <= baud <= lspclk / 16
    assert lib.ht_sci_start(started.port, baud) == possible
    assert (lib.ht_sci_baud(started.port) == before) != possible


def test_sci_recovers_from_a_framing_error_and_an_overflow(started):
    base = SCI[started.name]
    buffer = ffi.new("uint16_t[20]")
    for _ in range(20):
        lib.ht_regfile_sci_arrive(started.rf, 0x55)
    assert lib.ht_sci_read(started.port, buffer, 20) == 16
    assert started.word(base + 11) & 0x8000
    assert lib.ht_sci_recover(started.port)
    assert not started.word(base + 11) & 0x8000
    assert not lib.ht_sci_recover(started.port)
    lib.ht_regfile_word(started.rf, base + 5)[0] = 0x0090  # the line broke
    before = started.word(base + 3)
    assert lib.ht_sci_recover(started.port)
    assert started.word(base + 3) == before
    assert lib.ht_regfile_sci_arrive(started.rf, 0x77)
    assert lib.ht_sci_read(started.port, buffer, 20) == 1
    assert buffer[0] == 0x77
    assert started.rf.violations == 0


def test_sci_reads_only_the_requested_number(started):
    buffer = ffi.new("uint16_t[8]", [9] * 8)
    for n in range(5):
        lib.ht_regfile_sci_arrive(started.rf, n)
    assert lib.ht_sci_read(started.port, buffer, 3) == 3
    assert list(buffer) == [0, 1, 2, 9, 9, 9, 9, 9]
    assert lib.ht_sci_read(started.port, buffer, 8) == 2
    assert lib.ht_sci_write(started.port, buffer, 0) == 0


# --- pins ------------------------------------------------------------------------------


def pins(board):
    return {name: getattr(board, name) for name in
            ("trip", "encoder_a", "encoder_b", "encoder_index", "receive", "transmit")}  # fmt: skip


def test_pwm_pins_come_last(started):
    """Inputs until the PWM has been set up and tripped; no pull-up that could turn a
    switch on."""
    for pin in started.board.pwm:
        assert started.pin(pin.gpio) == (0, SYNC, False, False)
    started.init()
    for pin in started.board.pwm:
        assert started.pin(pin.gpio) == (pin.mux, SYNC, False, False)


def test_other_pins(started):
    used = pins(started.board)
    want = {"trip": (ASYNC, False), "encoder_a": (SIX_SAMPLES, True),
            "encoder_b": (SIX_SAMPLES, True), "encoder_index": (SIX_SAMPLES, True),
            "receive": (ASYNC, True), "transmit": (SYNC, True)}  # fmt: skip
    for name, (qualify, pull_up) in want.items():
        assert started.pin(used[name].gpio) == (used[name].mux, qualify, pull_up, False)
    if not started.small:
        assert started.word(0x7900) == used["trip"].gpio  # INPUT1SELECT -> TZ1
        assert used["trip"].mux == 0


def qualification_period(started, pin):
    """QUALPRD of the eight pins that this one is among."""
    first, stride = GPIO[started.name]
    control = started.long(first + pin.gpio // 32 * stride)
    return control >> 8 * (pin.gpio % 32 // 8) & 0xFF


def test_the_filter_of_an_input_does_not_depend_on_the_one_before(started):
    """A start without a reset finds the registers as something else left them."""
    board = Started(started.name)
    first, stride = GPIO[board.name]
    for pin in (board.board.encoder_a, board.board.encoder_b, board.board.encoder_index):
        word = lib.ht_regfile_word(board.rf, first + pin.gpio // 32 * stride)
        word[0] = word[1] = 0xFFFF
    assert lib.ht_board_start(board.port)
    for pin in (board.board.encoder_a, board.board.encoder_b, board.board.encoder_index):
        assert qualification_period(board, pin) == qualification_period(started, pin) < 0xFF


def test_encoder_inputs_are_filtered_but_not_too_much(started):
    """Six samples, every 2 QUALPRD system clocks: a level counts once it has lasted for six
    sampling periods and a clock. Spikes of 0.3 us must not count; the levels of an encoder of
    1 MHz a channel must, even if they last for only 45 % of its period."""
    clock = SYSCLK[started.name]
    for pin in (started.board.encoder_a, started.board.encoder_b, started.board.encoder_index):
        qualprd = qualification_period(started, pin)
        sampling = 2 * qualprd / clock
        assert 5 * sampling > 0.3e-6
        assert 6 * sampling + 1 / clock < 0.45e-6
    # and the defaults stay far below that
    table = parameters()
    counts_s = table["encoder_counts_rev"].initial * table["speed_trip_rpm"].initial / 60
    assert counts_s / 4 < 1e6 / 4


def test_pins_are_what_the_data_sheet_offers(started):
    """ePWM n A, B: GPIO 2n - 2, 2n - 1 at position 1, of ePWM9 on at position 5;
    the rest one by one."""
    board = started.board
    for leg in range(6):
        module = board.module[leg]
        position = 1 if module < 8 else 5
        pair = [(p.gpio, p.mux) for p in board.pwm[2 * leg : 2 * leg + 2]]
        assert pair == [(2 * module, position), (2 * module + 1, position)]
        assert board.modules >> module & 1
    assert board.modules & 1  # ePWM1 starts the ADC
    functions = {
        "f28335": {
            (12, 1): "TZ1",
            (20, 1): "A",
            (21, 1): "B",
            (23, 1): "I",
            (28, 1): "RX",
            (29, 1): "TX",
        },
        "f28377s": {(20, 1): "A", (21, 1): "B", (23, 1): "I", (28, 1): "RX", (29, 1): "TX"},
        "launchxl_f28377s": {
            (62, 5): "A",
            (63, 5): "B",
            (65, 5): "I",
            (85, 5): "RX",
            (84, 5): "TX",
        },
    }[started.name]
    used = pins(board)
    found = [functions.get((used[n].gpio, used[n].mux)) for n in list(used)[1:]]
    assert found == ["A", "B", "I", "RX", "TX"]
    everything = [p.gpio for p in (*board.pwm, *used.values())]
    assert len(set(everything)) == 18


def test_launchpad_uses_pins_that_exist():
    board = Started("launchxl_f28377s").board
    everything = {p.gpio for p in (*board.pwm, *pins(board).values())}
    assert not everything & UNBONDED


def test_launchpad_writes_the_same_pattern_elsewhere():
    """Legs on ePWM2, 6, 11, 8..10 instead of 1..6: the same values in the other modules."""
    card, pad = Started("f28377s"), Started("launchxl_f28377s")
    pattern = [0b101010, [1, 2, 3, 4, 5, 6], [11, 12, 13, 14, 15, 16]]
    for started in (card, pad):
        started.init()
        lib.ht_port_gates_on(started.port, ALL_LEGS)
        lib.ht_port_write(started.port, [pattern])
    offsets = (*range(0x00, 0x12), *range(0x40, 0x54), *range(0x60, 0x70), 0x80, 0x84, 0x93)
    for leg, module in enumerate((2, 6, 11, 8, 9, 10)):
        for offset in offsets:
            if leg == 0 and offset in (0x00, 0x61):
                continue  # ePWM1 is the time base on the card, a follower is leg 1 on the pad
            ours = pad.word(0x4000 + 0x100 * (module - 1) + offset)
            assert ours == card.word(0x4000 + 0x100 * leg + offset), (leg, hex(offset))
    assert pad.word(0x4093) & 4  # ePWM1 itself stays tripped
    assert pad.word(0x40A4) == card.word(0x40A4) == 0x0900


# --- a start that fails -------------------------------------------------------------------

RIGHT, MISSING, NO_LOCK, WRONG = range(4)


def only_the_line(started):
    """The state of a board with a wrong clock. No pin belongs to the PWM, not even after the
    drive's set-up. The serial line runs at 115200 baud from the remaining clock."""
    assert not started.good
    started.init()
    assert all(started.pin(pin.gpio)[0] == 0 for pin in started.board.pwm)
    assert all(not started.pin(pin.gpio)[3] for pin in started.board.pwm)
    assert not started.word(0x7029) & 0x40  # the watchdog goes on
    if started.small:  # crystal / 4 without PLL, LOSPCP 0: undivided
        assert (started.word(0x7021), started.word(0x7011) >> 7 & 3) == (0, 0)
        clock = 30e6 / 4
        assert started.word(0x701B) == 0
    else:  # internal oscillator 2, no PLL, LSPCLK undivided
        assert (started.long(0x5D208) & 3, started.long(0x5D20E), started.long(0x5D222)) == (
            0,
            0,
            0,
        )
        clock = 10e6
        assert started.long(0x5D22C) == 0
    sci = SCI[started.name]
    baud = clock / 8 / ((started.word(sci + 2) << 8 | started.word(sci + 3)) + 1)
    assert baud == pytest.approx(115200, rel=0.02)
    assert started.rf.violations == 0


@pytest.mark.parametrize("board", BOARDS)
def test_without_a_lock_no_start(board):
    started = Started(board, [("never_locks", 1)])
    assert started.port.clock == NO_LOCK
    only_the_line(started)


@pytest.mark.parametrize("percent", (90, 95, 105, 110, 200))
@pytest.mark.parametrize("board", BOARDS)
def test_with_a_wrong_lock_no_start(board, percent):
    """The PLL reports that it has locked, but oscillates at a wrong frequency."""
    started = Started(board, [("wrong_locks", 10_000), ("wrong_percent", percent)])
    assert started.port.clock == WRONG
    only_the_line(started)


@pytest.mark.parametrize(("board", "locks"), (("f28335", 1), ("f28335", 3), ("f28377s", 5),
                                              ("launchxl_f28377s", 20)))  # fmt: skip
def test_lock_that_comes_at_a_retry(board, locks):
    """F28377S: five locks a try. F28335: one to the wrong frequency, one back to the bypass."""
    started = Started(board, [("wrong_locks", locks), ("wrong_percent", 80)])
    assert started.good and started.port.clock == RIGHT
    started.init()
    assert started.rf.violations == 0
    assert started.rf.pll_share == 1.0
    assert all(started.pin(pin.gpio)[0] != 0 for pin in started.board.pwm)


@pytest.mark.parametrize(("board", "crystal_Hz"), (("f28377s", 10e6), ("f28377s", 25e6),
                                                   ("launchxl_f28377s", 20e6)))  # fmt: skip
def test_another_crystal_than_the_table_says(board, crystal_Hz):
    """Compared with this crystal the PLL is right. The internal oscillator shows the error."""
    started = Started(board, [("crystal_Hz", crystal_Hz)])
    assert started.port.clock == WRONG
    only_the_line(started)


@pytest.mark.parametrize("board", ("f28377s", "launchxl_f28377s"))
def test_without_a_crystal_the_link_works(board):
    started = Started(board, [("no_crystal", 1)])
    assert started.port.clock == MISSING
    only_the_line(started)


def test_a_missing_clock_of_an_earlier_run_is_checked_again():
    board = ffi.addressof(lib.ht_board_f28377s)
    rf, port = ffi.new("ht_regfile *"), ffi.new("ht_port *")
    lib.ht_regfile_reset(rf, board.map)
    lib.ht_regfile_word(rf, 0x5D22E)[0] = 1  # MCLKSTS
    lib.ht_port_bind(port, rf, board)
    assert lib.ht_board_start(port)


def test_without_a_crystal_no_start():
    """The F28335 has no other oscillator, only a clock of a few MHz with unknown frequency."""
    rf, port = ffi.new("ht_regfile *"), ffi.new("ht_port *")
    board = ffi.addressof(lib.ht_board_f28335)
    lib.ht_regfile_reset(rf, board.map)
    rf.word[0x7011] |= 0x0008  # PLLSTS.MCLKSTS: limp mode
    lib.ht_port_bind(port, rf, board)
    assert not lib.ht_board_start(port)
    assert port.clock == MISSING
    assert lib.ht_port_init(port, [[10000, 200, True, 100.0]])
    assert rf.word[0x7021] == 0
    assert lib.ht_regfile_word(rf, 0x6F86)[0] == 0  # GPAMUX1
    assert rf.violations == 0


def test_with_a_slipping_pll_no_start():
    started = Started("f28377s", [("slips", 1)])
    assert started.port.clock == WRONG
    only_the_line(started)


def test_no_gate_of_the_launchpad_is_on_its_leds():
    """GPIO12 and GPIO13 have the board's LEDs, which pull the pins up while they are inputs, as in
    every reset. A gate driver there could switch on."""
    board = lib.ht_board_launchxl_f28377s
    pwm = [board.pwm[n].gpio for n in range(12)]
    assert not {12, 13} & set(pwm)
    others = pins(board).values()
    outputs = [pin.gpio for pin in board.output]
    assert len({*pwm, *(pin.gpio for pin in others), *outputs}) == 12 + 6 + 4
    assert not {12, 13} & set(outputs)


@pytest.mark.parametrize("name", ("f28335", "f28377s", "launchxl_f28377s"))
def test_the_encoder_module_is_the_boards(name):
    """TI's pin maps: GPIO20 and 21 are eQEP1's at position 1 of both chips, GPIO62 and 63 are
    eQEP3's at position 5 of the F28377S. Base addresses: 0x6B00, 0x5100, 0x5180."""
    started = Started(name)
    board, port, words = started.board, started.port, started.rf.word
    base, pins = {
        "f28335": (0x6B00, ((20, 1), (21, 1))),
        "f28377s": (0x5100, ((20, 1), (21, 1))),
        "launchxl_f28377s": (0x5180, ((62, 5), (63, 5))),
    }[name]
    assert port.eqep == base
    assert tuple((p.gpio, p.mux) for p in (board.encoder_a, board.encoder_b)) == pins
    words[base] = 1234
    samples = ffi.new("ht_samples *")
    lib.ht_port_read(port, samples)
    assert samples.position == 1234
    assert not started.rf.violations


@pytest.mark.parametrize("name", ("f28335", "f28377s", "launchxl_f28377s"))
def test_pins_that_end_in_the_package_are_pulled_up(name):
    """Data sheet: pins without a bond need their pull-ups, or they float. Those that have a bond
    are left to the board, except for the ones in use."""
    started = Started(name)
    first, stride = GPIO[name]
    ports = 2 if started.small else 6
    up = {
        32 * port + n
        for port in range(ports)
        for n in range(32)
        if not started.long(first + port * stride + 0x0C) >> n & 1
    }
    if name == "launchxl_f28377s":
        beyond = {*range(96, 169)} - {99}
        assert (UNBONDED - {96, 97, 98}) | beyond <= up
        assert up - UNBONDED - beyond <= {pin.gpio for pin in pins(started.board).values()}
    elif name == "f28377s":
        assert up == {20, 21, 23, 28, 29}
    assert started.rf.violations == 0


#: Levels of port A, distance to the next port's.
LEVELS = {"f28335": (0x6FC0, 8), "f28377s": (0x7F00, 8), "launchxl_f28377s": (0x7F00, 8)}


@pytest.mark.parametrize("name", BOARDS)
def test_outputs_are_inputs_until_the_start_makes_them_low(name):
    """An input is what the board's resistor makes of it: relay open, brake closed, fan and chopper
    off. Then each bit moves its own pin and no other, and only if it is asked for."""
    started = Started.__new__(Started)
    started.name, started.rf = name, ffi.new("ht_regfile *")
    board = getattr(lib, f"ht_board_{name}")
    lib.ht_regfile_reset(started.rf, board.map)
    pins = [pin.gpio for pin in board.output]
    assert not any(started.pin(gpio)[3] or started.pin(gpio)[0] for gpio in pins)
    started = Started(name)
    first, stride = LEVELS[name]

    def levels():
        return {
            gpio for gpio in range(96)
            if started.long(first + gpio // 32 * stride) >> gpio % 32 & 1
        }  # fmt: skip

    idle = levels()
    for gpio in pins:
        mux, _, pulled_up, output = started.pin(gpio)
        assert (mux, pulled_up, output) == (0, False, True)
        assert gpio not in idle
    everything = (1 << lib.HT_OUTPUTS) - 1
    assert everything == 15 and len(pins) == 4
    for before in range(16):
        for which in range(16):
            lib.ht_port_outputs(started.port, everything, before)
            lib.ht_port_outputs(started.port, which, 0b1010)
            after = before & ~which | which & 0b1010
            assert levels() - idle == {gpio for n, gpio in enumerate(pins) if after >> n & 1}
            assert idle <= levels()
    assert (lib.HT_OUT_PRECHARGE, lib.HT_OUT_BRAKE, lib.HT_OUT_FAN) == (1, 2, 4)
    assert lib.HT_OUT_CHOPPER == 8
    # A debugger starts the image anew: the pins are inputs before anything else is set up.
    lib.ht_pins_release(started.port)
    assert not any(started.pin(gpio)[3] for gpio in pins)
    lib.ht_board_start(started.port)
    assert levels() == idle and all(started.pin(gpio)[3] for gpio in pins)
    assert not started.rf.violations
