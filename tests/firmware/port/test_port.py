"""The C2000 driver against register values worked out from TI's reference
manuals: set-up image, pattern image, gates, readings. No access may be one that
the chip refuses.
"""

import pytest

from hexatorque.firmware import ALL_LEGS, ffi, lib

#: Register offsets in a PWM module, from the manuals.
OFFSETS = {
    "f28335": {
        "TBCTL": 0x00, "TBPHS": 0x03, "TBCTR": 0x04, "TBPRD": 0x05, "CMPCTL": 0x07, "CMPA": 0x09,
        "CMPB": 0x0A, "AQCTLA": 0x0B, "AQSFRC": 0x0D, "AQCSFRC": 0x0E, "DBCTL": 0x0F,
        "DBRED": 0x10, "DBFED": 0x11, "TZSEL": 0x12, "TZCTL": 0x14, "TZFLG": 0x16,
        "ETSEL": 0x19, "ETPS": 0x1A, "ETFLG": 0x1B,
    },
    "f28377s": {
        "TBCTL": 0x00, "TBPHS": 0x61, "TBCTR": 0x04, "TBPRD": 0x63, "CMPCTL": 0x08, "CMPA": 0x6B,
        "CMPB": 0x6D, "AQCTL": 0x10, "AQCTLA": 0x40, "AQSFRC": 0x47, "AQCSFRC": 0x49,
        "DBCTL": 0x0C, "DBRED": 0x51, "DBFED": 0x53, "TZSEL": 0x80, "TZCTL": 0x84,
        "TZFLG": 0x93, "ETSEL": 0xA4, "ETPS": 0xA6, "ETFLG": 0xA8,
    },
}  # fmt: skip
BASE = {"f28335": (0x6800, 0x40), "f28377s": (0x4000, 0x100)}
ADC = {
    "f28335": (range(0x7108, 0x710F), 4),
    "f28377s": ((0x0B00, 0x0B20, 0x0B01, 0x0B21, 0x0B02, 0x0B22, 0x0B03), 0),
}
QPOSCNT = {"f28335": 0x6B00, "f28377s": 0x5100}
DEAD_MAX = {"f28335": 1023, "f28377s": 16383}
#: 1 us, the shortest dead time of the boards.
DEAD_MIN = {"f28335": 150, "f28377s": 100}
#: One-shot trips: TZ1, the pin; on the F28377S clock failure (TZ5), emulation stop (TZ6), the
#: dead-man timer (DCAEVT1) and the comparators (DCBEVT1) too. What they do to the outputs; DCAEVT1
#: itself acts on output A, DCBEVT1 on output B.
ONE_SHOT = {"f28335": 0x0100, "f28377s": 0xF100}
ALL_LOW = {"f28335": 0x000A, "f28377s": 0x022A}
ALL_HIGH = {"f28335": 0x0005, "f28377s": 0x0115}
CLOCKS = {"f28335": (0x701D, 0x701C), "f28377s": (0x5D326, 0x5D323)}
#: eQEP1 clock enable: PCLKCR1.EQEP1ENCLK, PCLKCR4.EQEP1; SYSCLKOUT.
EQEP_CLOCK = {"f28335": (0x701D, 0x4000), "f28377s": (0x5D32A, 0x0001)}
SYSCLKOUT = {"f28335": 150e6, "f28377s": 200e6}
PERCLKDIVSEL, PIEACK = 0x5D226, 0x0CE1
OST = 0x0004


class Board:
    """A board after its start. planted: earlier contents of some words. active_low: gate drivers
    that invert."""

    def __init__(self, device, planted=(), active_low=False):
        self.device = device
        self.table = board = ffi.new("ht_board *", getattr(lib, f"ht_board_{device}"))
        self.rf = ffi.new("ht_regfile *")
        self.port = ffi.new("ht_port *")
        lib.ht_regfile_reset(self.rf, board.map)
        board.gates_active_low = self.rf.gates_active_low = active_low
        for address, value in planted:
            lib.ht_regfile_word(self.rf, address)[0] = value
        lib.ht_port_bind(self.port, self.rf, board)
        assert lib.ht_board_start(self.port)

    def init(self, period=15000, dead=345, shadow=True):
        return lib.ht_port_init(self.port, [[period, dead, shadow, 100.0]])

    def reg(self, name, leg=0):
        base, stride = BASE[self.device]
        return self.rf.word[base + leg * stride + OFFSETS[self.device][name]]

    def image(self, *names):
        return [tuple(self.reg(name, leg) for name in names) for leg in range(6)]

    @property
    def latched(self):
        """For each leg, whether its one-shot latch holds the gates off."""
        return [bool(flag & OST) for (flag,) in self.image("TZFLG")]

    def eqep(self, offset):
        return self.rf.word[QPOSCNT[self.device] + offset]

    def word(self, address):
        return lib.ht_regfile_word(self.rf, address)[0]

    def write(self, start, ca, cb):
        lib.ht_port_write(self.port, [[start, ca, cb]])


@pytest.fixture(params=BASE)
def board(request):
    return Board(request.param)


@pytest.mark.parametrize("shadow", (True, False))
def test_set_up_of_the_counters(board, shadow):
    assert board.init(period=12345, dead=321, shadow=shadow)
    # free run, up-count, undivided; leg 1 sends sync at zero, the others follow
    assert board.image("TBCTL") == [(0x8010,)] + [(0x8004,)] * 5
    # the sync signal takes two clocks, so those who get it are at 2 by then
    assert board.image("TBPRD", "TBPHS", "TBCTR") == [(12344, 0, 0)] + [(12344, 2, 0)] * 5
    assert board.image("CMPA", "CMPB") == [(12345, 12345)] * 6
    assert board.image("CMPCTL") == [(0x0000 if shadow else 0x0050,)] * 6
    assert board.rf.violations == 0


@pytest.mark.parametrize("shadow", (True, False))
def test_set_up_of_actions_dead_time_trips_and_conversion(board, shadow):
    assert board.init(period=12345, dead=321, shadow=shadow)
    # toggle on CAU and CBU; clear at zero under shadow load
    assert board.image("AQCTLA") == [(0x0331 if shadow else 0x0330,)] * 6
    if board.device == "f28377s":  # type 4 can shadow AQCTLA: load at period
        assert board.image("AQCTL") == [(0x0011 if shadow else 0x0000,)] * 6
    # active-high complementary, both delays from A
    assert board.image("AQCSFRC", "DBCTL", "DBRED", "DBFED") == [(0, 0x000B, 321, 321)] * 6
    assert board.image("TZSEL", "TZCTL") == [(ONE_SHOT[board.device], ALL_LOW[board.device])] * 6
    # one start of conversion per period, from leg 1 only; no interrupt
    assert board.image("ETSEL", "ETPS") == [(0x0900, 0x0100)] + [(0, 0)] * 5
    assert board.rf.violations == 0


def test_set_up_leaves_the_gates_off(board):
    assert board.init()
    assert all(board.latched)
    assert lib.ht_port_tripped(board.port, ALL_LEGS)


def test_set_up_clocks(board):
    assert board.init()
    enable, sync = CLOCKS[board.device]
    assert board.word(enable) & 0x3F == 0x3F
    assert board.word(sync) & 0x0004
    if board.device == "f28377s":
        assert board.word(PERCLKDIVSEL) & 0x3 == 1  # 200 MHz / 2


def test_set_up_of_the_encoder_interface(board):
    board.rf.word[QPOSCNT[board.device]] = 1234  # the counter may stand anywhere
    assert board.init()
    address, bit = EQEP_CLOCK[board.device]
    assert board.word(address) & bit
    assert board.eqep(0x14) == 0  # QDECCTL: quadrature count mode, nothing inverted
    assert board.eqep(0x04) == board.eqep(0x05) == 0xFFFF  # QPOSMAX
    # QEPCTL: reset at QPOSMAX only (PCRM = 1), latch at the index's rise (IEL = 1), enabled, no
    # latch by the unit timer
    assert board.eqep(0x15) & 0x3FFF == 0x1018
    # QCAPCTL: enabled, SYSCLKOUT / 2^7, unit event every 2^2 edges
    assert board.eqep(0x16) == 0x8000 | 7 << 4 | 2
    assert lib.ht_port_capture_clock_Hz(board.port) == SYSCLKOUT[board.device] / 128
    assert 1 << 2 == lib.HT_CAPTURE_COUNTS
    assert board.eqep(0) == 1234
    assert board.rf.violations == 0


#: Bits of the capture unit's status register.
CAPTURE_BITS = {"event": 7, "forward": 5, "overflow": 3, "reversed": 2}


@pytest.mark.parametrize("bit", range(16))
def test_reading_the_capture_unit(board, bit):
    """Each status bit alone: reported where it belongs, cleared where it can be."""
    board.init()
    base = QPOSCNT[board.device]
    for offset, value in ((0x1C, 1 << bit), (0x1D, 40001), (0x1E, 65535)):
        board.rf.word[base + offset] = value
    look = ffi.new("ht_capture *")
    before = board.rf.accesses
    lib.ht_port_read_capture(board.port, look)
    assert board.rf.accesses - before == 5
    assert not look.index
    assert (look.age_ticks, look.period_ticks) == (40001, 65535)
    for name, own in CAPTURE_BITS.items():
        assert getattr(look, name) == (bit == own)
    # Cleared by the look: UPEVNT, COEF, CDEF. Not ours: the first index marker.
    assert board.eqep(0x1C) == (0 if bit in (7, 3, 2) else 1 << bit)
    assert board.rf.violations == 0


def test_an_absolute_encoder_is_read_where_the_plant_has_one(board):
    board.init()
    assert lib.ht_port_read_absolute(board.port) == 0xFFFFFFFF
    for reading in (0, 1, 0x12345678 - 1, 2**24 - 1):
        told = reading + 1
        board.rf.word[0x400], board.rf.word[0x401] = told & 0xFFFF, told >> 16
        assert lib.ht_port_read_absolute(board.port) == reading
    assert board.rf.violations == 0


def test_reading_the_index_latch(board):
    """It is reported once."""
    board.init()
    base = QPOSCNT[board.device]
    board.rf.word[base + 0x08], board.rf.word[base + 0x09] = 0x5678, 0x1234
    board.rf.word[base + 0x19] = 0x0FFF  # every flag
    look = ffi.new("ht_capture *")
    lib.ht_port_read_capture(board.port, look)
    assert look.index and look.index_position == 0x12345678
    assert board.eqep(0x19) == 0x0BFF  # no other flag is ours
    lib.ht_port_read_capture(board.port, look)
    assert not look.index
    assert board.rf.violations == 0


def test_set_up_keeps_the_clock_bits_of_other_modules(board):
    eqep, eqep_bit = EQEP_CLOCK[board.device]
    registers = {*CLOCKS[board.device], eqep}
    board = Board(board.device, [(address, 0xA500) for address in registers])
    assert board.init()
    for address in registers:
        ours = 0x04FF | (eqep_bit if address == eqep else 0)  # 0x0400: SCI-A of the F28335
        assert board.word(address) & ~ours == 0xA500 & ~ours


def test_clock_of_the_time_base(board):
    clock = {"f28335": 150e6, "f28377s": 100e6}
    assert lib.ht_port_pwm_clock_Hz(board.port) == clock[board.device]


def test_dead_time_has_a_minimum(board):
    least = DEAD_MIN[board.device]
    assert board.init(dead=least)
    for dead in (0, 1, least - 1):
        other = Board(board.device)
        assert not other.init(dead=dead)
        assert all(other.latched)
        assert other.image("DBRED", "DBFED") == [(0, 0)] * 6
        assert other.rf.violations == 0
    span = lib.ht_port_dead_range(board.port)
    assert span.min_us == 1.0
    assert span.max_us == pytest.approx(1023 / 150 if board.device == "f28335" else 163.83)


def test_dead_time_fills_its_register_and_no_more(board):
    limit = DEAD_MAX[board.device]
    assert board.init(dead=limit)
    assert board.image("DBRED", "DBFED") == [(limit, limit)] * 6
    other = Board(board.device)
    assert not other.init(dead=limit + 1)
    assert all(other.latched)
    assert other.rf.violations == 0


def test_accepts_predicts_init_and_writes_nothing(board):
    limit = DEAD_MAX[board.device]
    least = DEAD_MIN[board.device]
    for period, dead in (
        (7, least), (8, least), (8, least - 1), (8, 0), (65535, limit), (15000, limit + 1),
    ):  # fmt: skip
        before = bytes(ffi.buffer(board.rf))
        accepted = lib.ht_port_accepts(board.port, [[period, dead, True, 100.0]])
        assert bytes(ffi.buffer(board.rf)) == before
        assert Board(board.device).init(period, dead) == accepted


@pytest.mark.parametrize(("period", "fits"), ((7, False), (8, True), (65535, True)))
def test_period_range(board, period, fits):
    assert board.init(period=period) == fits
    assert lib.ht_port_tripped(board.port, ALL_LEGS)
    if fits:
        assert board.reg("TBPRD", 5) == period - 1


CA = [1, 20, 300, 4000, 15000, 14998]
CB = [2, 15000, 301, 5000, 15000, 14999]


@pytest.mark.parametrize("start", (0b100000, 0b000001, 0b010110, 0, 63))
def test_pattern_under_shadow_load(board, start):
    board.init(shadow=True)
    board.write(start, CA, CB)
    assert board.image("CMPA", "CMPB") == list(zip(CA, CB, strict=True))
    high = [start >> (5 - leg) & 1 for leg in range(6)]
    assert board.image("AQCTLA") == [(0x0332 if h else 0x0331,) for h in high]
    assert board.image("AQSFRC") == [(0,)] * 6
    assert board.rf.violations == 0


@pytest.mark.parametrize("start", (0b100000, 0b000001, 0b010110, 0, 63))
def test_pattern_under_immediate_load(board, start):
    board.init(shadow=False)
    board.write(start, CA, CB)
    assert board.image("CMPA", "CMPB") == list(zip(CA, CB, strict=True))
    high = [start >> (5 - leg) & 1 for leg in range(6)]
    assert board.image("AQCTLA") == [(0x0330,)] * 6  # nothing at zero
    assert board.image("AQSFRC") == [(0x0006 if h else 0x0005,) for h in high]
    assert board.rf.violations == 0


def test_pattern_does_not_touch_the_gates(board):
    board.init()
    board.write(63, CA, CB)
    assert lib.ht_port_tripped(board.port, ALL_LEGS)
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    board.write(0, CA, CB)
    assert not lib.ht_port_tripped(board.port, ALL_LEGS)


def test_gates_on_and_off(board):
    board.init()
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    assert board.image("TZFLG") == [(0,)] * 6
    assert not lib.ht_port_tripped(board.port, ALL_LEGS)
    for _ in range(2):  # idempotent
        lib.ht_port_gates_off(board.port)
        assert all(board.latched)
        assert lib.ht_port_tripped(board.port, ALL_LEGS)
    assert board.rf.violations == 0
    assert board.rf.eallow == 0


#: TZB and TZA: the lower switch, B, is told to go on, and the upper one off.
LOWER_ON = {False: 0x0006, True: 0x0009}


@pytest.mark.parametrize("active_low", (False, True))
def test_the_short_circuit_forces_the_lower_switches_on(board, active_low):
    """TZA and TZB alone change. The latches stay set, whatever else trips. Gates off ends it."""
    board = Board(board.device, active_low=active_low)
    board.init()
    off = (ALL_HIGH if active_low else ALL_LOW)[board.device]
    lower_on = off & ~0xF | LOWER_ON[active_low]
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    lib.ht_port_gates_off(board.port)
    for _ in range(2):  # idempotent
        lib.ht_port_short_circuit(board.port)
        assert board.image("TZCTL") == [(lower_on,)] * 6
        assert all(board.latched)
    board.write(63, CA, CB)  # no pattern reaches a latched leg
    lib.ht_regfile_pin(board.rf, board.port.board.trip.gpio, 0)
    lib.ht_regfile_pin(board.rf, board.port.board.trip.gpio, 1)
    assert board.image("TZCTL") == [(lower_on,)] * 6
    lib.ht_port_gates_off(board.port)
    assert board.image("TZCTL") == [(off,)] * 6
    assert all(board.latched)
    assert board.rf.violations == 0
    assert board.rf.eallow == 0


@pytest.mark.parametrize("leg", range(6))
def test_one_leg_off(board, leg):
    """The others go on."""
    board.init()
    word = 32 >> leg
    rest = ALL_LEGS & ~word
    assert lib.ht_port_gates_on(board.port, ALL_LEGS)
    for _ in range(2):  # idempotent
        lib.ht_port_leg_off(board.port, leg)
        assert board.latched == [n == leg for n in range(6)]
        assert lib.ht_port_tripped(board.port, word)
        assert not lib.ht_port_tripped(board.port, rest)
    assert (board.rf.violations, board.rf.eallow) == (0, 0)


@pytest.mark.parametrize("leg", range(6))
def test_a_release_without_a_leg_leaves_it_off(board, leg):
    board.init()
    assert lib.ht_port_gates_on(board.port, ALL_LEGS)
    lib.ht_port_leg_off(board.port, leg)
    lib.ht_port_gates_off(board.port)
    assert all(board.latched)
    assert lib.ht_port_gates_on(board.port, ALL_LEGS & ~(32 >> leg))
    assert board.latched == [n == leg for n in range(6)]
    lib.ht_port_gates_off(board.port)
    lib.ht_port_leg_off(board.port, leg)  # nothing that is off goes on
    assert all(board.latched)
    assert board.rf.violations == 0
    assert board.rf.eallow == 0


@pytest.mark.parametrize("leg", range(6))
def test_external_trip_is_seen_on_any_leg(board, leg):
    board.init()
    assert lib.ht_port_gates_on(board.port, ALL_LEGS)
    base, stride = BASE[board.device]
    board.rf.word[base + leg * stride + OFFSETS[board.device]["TZFLG"]] = OST
    assert lib.ht_port_tripped(board.port, ALL_LEGS)
    told = [lib.ht_port_leg_tripped(board.port, n) for n in range(6)]
    assert told == [n == leg for n in range(6)]


def test_gates_stay_off_while_the_trip_pin_is_low(board):
    board.init()
    gpio = board.port.board.trip.gpio
    assert not lib.ht_port_trip_pin_low(board.port)
    lib.ht_regfile_pin(board.rf, gpio, 0)
    assert lib.ht_port_trip_pin_low(board.port)
    before = board.rf.accesses
    assert not lib.ht_port_gates_on(board.port, ALL_LEGS)
    assert board.rf.accesses - before == 1  # the look; no latch is written to
    assert all(board.latched)
    lib.ht_regfile_pin(board.rf, gpio, 1)
    assert not lib.ht_port_trip_pin_low(board.port)
    assert all(board.latched)  # latched all the same
    assert board.rf.violations == 0


def test_the_trip_pin_latches_by_itself_without_code(board):
    board.init()
    assert lib.ht_port_gates_on(board.port, ALL_LEGS)
    assert board.image("TZFLG") == [(0,)] * 6
    lib.ht_regfile_pin(board.rf, board.port.board.trip.gpio, 0)
    assert all(board.latched)
    assert board.rf.violations == 0


def test_levels_of_the_pins_are_read_where_the_manuals_have_them(board):
    data = {"f28335": 0x6FC0, "f28377s": 0x7F00}[board.device]  # GPADAT
    board.init()
    outputs = {pin.gpio for pin in board.port.board.output}
    high = 0xFFFFFFFF & ~sum(1 << gpio for gpio in outputs if gpio < 32)
    for gpio in set(range(32)) - outputs:
        lib.ht_regfile_pin(board.rf, gpio, 0)
        assert board.word(data) | board.word(data + 1) << 16 == high & ~(1 << gpio)
        assert lib.ht_port_trip_pin_low(board.port) == (gpio == 12)
        lib.ht_regfile_pin(board.rf, gpio, 1)


@pytest.mark.parametrize("what", ("clock_fails", "emulation_stops"))
def test_other_causes_that_switch_off(board, what):
    board.init()
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    getattr(lib, f"ht_regfile_{what}")(board.rf)
    assert lib.ht_port_tripped(board.port, ALL_LEGS) == (board.device == "f28377s")


@pytest.mark.parametrize("device", BASE)
def test_inverting_gate_drivers(device):
    """Off is high: in a trip, and (output A inverted, not B) in the dead time."""
    board = Board(device, active_low=True)
    assert board.init()
    assert lib.ht_port_gates_on(board.port, ALL_LEGS)
    image = board.image("DBCTL", "DBRED", "DBFED", "TZCTL")
    assert image == [(0x0007, 345, 345, ALL_HIGH[device])] * 6
    assert board.rf.violations == 0


def test_slow_readings(board):
    """The winding's thermistor is the eighth input of the F28335 and A5 of the F28377S, the heat
    sink's B0 and B5. On the F28335 they take turns, and what the sequence converts stays."""
    lib.ht_board_start(board.port)
    board.init()
    _, shift = ADC[board.device]
    selects = board.device == "f28335"
    results = (0x710F, 0x710F) if selects else (0x0B04, 0x0B23)
    for channel, count in ((0, 1234), (1, 4095), (0, 0), (1, 77)):
        if selects:
            assert board.rf.word[0x7104] == ((7, 8)[channel] << 12 | 0x654)
        board.rf.word[results[channel]] = count << shift
        assert lib.ht_port_read_slow(board.port, channel, 1 - channel) == count
    assert board.rf.violations == 0


def test_readings(board):
    board.init()
    addresses, shift = ADC[board.device]
    counts = [0, 1, 2047, 2048, 2049, 4095, 1234]
    for address, count in zip(addresses, counts):
        board.rf.word[address] = count << shift
    board.rf.word[QPOSCNT[board.device]] = 0xFFFE
    board.rf.word[QPOSCNT[board.device] + 1] = 0x8001
    samples = ffi.new("ht_samples *")
    lib.ht_port_read(board.port, samples)
    assert list(samples.adc) == counts
    assert samples.position == 0x8001FFFE
    assert board.rf.violations == 0


def test_acknowledge(board):
    """The end of a conversion sequence: ADCST.INT_SEQ1, ADCINTFLG.ADCINT1. The other
    flags there are someone else's."""
    board.init()
    flags, others = {"f28335": (0x7119, 0x0002), "f28377s": (0x7403, 0x000E)}[board.device]
    board.rf.word[flags] = others | 1
    board.rf.word[PIEACK] = 0x0FFF
    lib.ht_port_begin_fast(board.port)
    assert board.rf.word[flags] == others
    assert not lib.ht_port_overrun(board.port)
    board.rf.word[flags] = 0x0001
    assert lib.ht_port_overrun(board.port)
    lib.ht_port_ack_fast(board.port)
    assert board.rf.word[PIEACK] == 0x0FFE  # group 1: ADC and CPU timer
    assert board.rf.violations == 0


@pytest.mark.parametrize("again", (False, True))
def test_acknowledge_at_the_end_of_a_conversion(again):
    """Errata SPRZ422, ADC interrupts: the flag must be clear afterwards, so that the next end
    shows as an overrun, and further interrupts must come."""
    board = Board("f28377s")
    board.init()
    asked = []
    isr = ffi.callback("void(void)", lambda: asked.append(1))
    board.rf.vector[32] = isr
    board.rf.word[0x0CE0] = 1
    board.rf.word[0x0CE2] = 1
    board.rf.ier = 1
    for _ in range(2 if again else 1):
        board.rf.event_at = board.rf.accesses + 1
        lib.ht_port_begin_fast(board.port)
        assert (board.rf.word[0x7403], board.rf.word[0x7405]) == (0, 0)
        assert not lib.ht_port_overrun(board.port)
    for _ in range(3):
        board.rf.word[PIEACK] = 0
        board.rf.intm = 0
        lib.ht_regfile_end_of_sequence(board.rf)
    assert len(asked) >= 3
    assert board.rf.violations == 0


def test_overrun_is_seen_in_every_case():
    """With INT1CONT an interrupt comes whatever the flag is. The flag must show the overrun."""
    board = Board("f28377s")
    board.init()
    lib.ht_regfile_end_of_sequence(board.rf)
    lib.ht_regfile_end_of_sequence(board.rf)
    assert board.rf.word[0x7405] == 1
    lib.ht_port_begin_fast(board.port)
    assert not lib.ht_port_overrun(board.port)
    lib.ht_regfile_end_of_sequence(board.rf)
    assert lib.ht_port_overrun(board.port)
    assert board.rf.violations == 0


def test_stale_flag_of_the_f28335_is_cleared_at_the_start():
    """After a start by a debugger, INT_SEQ1 may still be set by the last run. Then no interrupt
    would come."""
    assert Board("f28335", [(0x7119, 1)]).rf.word[0x7119] == 0


def test_fixed_number_of_accesses(board):
    board.init()
    samples = ffi.new("ht_samples *")
    for start in (0, 63, 0b101010):
        before = board.rf.accesses
        lib.ht_port_read(board.port, samples)
        assert board.rf.accesses - before == 8  # seven results, the counter in one
        board.write(start, CA, CB)
        assert board.rf.accesses - before == 8 + 18


def test_the_dead_man_timer_never_goes_back_into_its_pulse():
    """eCAP1's output is high below the compare value. A fast interrupt sets the counter back to it;
    one that finds the pulse under way leaves the counter alone, so that the pulse ends."""
    board = Board("f28377s")
    board.init()
    counter, pulse = 0x5000, board.rf.word[0x5006]
    for before, after in ((pulse + 1, pulse), (40000, pulse), (pulse - 1, pulse - 1), (0, 0)):
        board.rf.word[counter] = before
        lib.ht_port_begin_fast(board.port)
        assert board.rf.word[counter] == after
    assert not board.rf.ecap_high
    assert board.rf.violations == 0


@pytest.mark.parametrize("device", ("f28335", "f28377s"))
def test_a_lost_interrupt_is_told_until_the_gates_go_on(device):
    board = Board(device)
    board.init()
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    assert not lib.ht_port_interrupt_lost(board.port)
    lib.ht_regfile_wait(board.rf, 1000)
    assert lib.ht_port_interrupt_lost(board.port)
    lib.ht_port_begin_fast(board.port)
    assert lib.ht_port_interrupt_lost(board.port)
    lib.ht_port_gates_on(board.port, ALL_LEGS)
    assert not lib.ht_port_interrupt_lost(board.port)
