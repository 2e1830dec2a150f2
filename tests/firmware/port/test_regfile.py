"""The register model, compared with the chips' reference manuals. Addresses
and bits are from the manuals, not from the model's tables.
"""

import pytest

from hexatorque.firmware import ffi, lib

OST, INT = 0x0004, 0x0001
NO_EALLOW, HOLE, READ_ONLY = lib.HT_REG_NO_EALLOW, lib.HT_REG_HOLE, lib.HT_REG_READ_ONLY
RESERVED, WIDTH, UNCLOCKED = lib.HT_REG_RESERVED, lib.HT_REG_WIDTH, lib.HT_REG_UNCLOCKED
ORDER, KEY, WATCHDOG = lib.HT_REG_ORDER, lib.HT_REG_KEY, lib.HT_REG_WATCHDOG

#: Word addresses from TI's manuals, ePWM1, and the distance to the next module.
CHIPS = {
    "f28335": {
        "base": 0x6800, "stride": 0x40, "TBCTL": 0x6800, "TBPRD": 0x6805, "CMPA": 0x6809,
        "AQCTLA": 0x680B, "DBCTL": 0x680F, "DBRED": 0x6810, "DBFED": 0x6811, "TZSEL": 0x6812,
        "TZCTL": 0x6814, "TZEINT": 0x6815, "TZFLG": 0x6816, "TZCLR": 0x6817, "TZFRC": 0x6818,
        "ETFLG": 0x681B, "ETCLR": 0x681C,
        "eqep": 0x6B00, "sci": 0x7050, "GPAMUX1": 0x6F86, "GPAPUD": 0x6F8C,
    },
    "f28377s": {
        "base": 0x4000, "stride": 0x100, "TBCTL": 0x4000, "TBPRD": 0x4063, "CMPA": 0x406B,
        "AQCTLA": 0x4040, "DBCTL": 0x400C, "DBRED": 0x4051, "DBFED": 0x4053, "TZSEL": 0x4080,
        "TZCTL": 0x4084, "TZEINT": 0x408D, "TZFLG": 0x4093, "TZCLR": 0x4097, "TZFRC": 0x409B,
        "ETFLG": 0x40A8, "ETCLR": 0x40AA,
        "eqep": 0x5100, "sci": 0x7200, "GPAMUX1": 0x7C06, "GPAPUD": 0x7C0C,
    },
}  # fmt: skip
#: Clock enables of ePWM1..6, eQEP1, SCI-A, ADC(-A), CPU timer 0: (register, bits).
CLOCKS = {
    "f28335": {0x701D: 0x403F, 0x701C: 0x0408, 0x7020: 0x0100},
    "f28377s": {0x5D326: 0x3F, 0x5D32A: 1, 0x5D330: 1, 0x5D33C: 1, 0x5D322: 8},
}
TBCLKSYNC = {"f28335": (0x701C, 0x0004), "f28377s": (0x5D322, 0x40000)}
PIEACK = 0x0CE1
PROTECTED = ("TZSEL", "TZCTL", "TZEINT", "TZCLR", "TZFRC")


class Chip:
    def __init__(self, device, clocked=True):
        self.device = device
        self.at = CHIPS[device]
        self.rf = ffi.new("ht_regfile *")
        lib.ht_regfile_reset(self.rf, ffi.addressof(getattr(lib, f"ht_{device}")))
        if clocked:
            for address, bits in CLOCKS[device].items():
                self.word(address)[0] |= bits
            lib.ht_regfile_settle(self.rf)

    def word(self, address):
        return lib.ht_regfile_word(self.rf, address)

    def address(self, name, leg=0):
        return self.at[name] + leg * self.at["stride"] if isinstance(name, str) else name

    def read(self, name, leg=0):
        return lib.ht_regfile_read16(self.rf, self.address(name, leg))

    def write(self, name, value, leg=0):
        lib.ht_regfile_write16(self.rf, self.address(name, leg), value)

    def read32(self, name):
        return lib.ht_regfile_read32(self.rf, self.address(name))

    def write32(self, name, value):
        lib.ht_regfile_write32(self.rf, self.address(name), value)

    def change(self, address, value):
        """A register as wide as the device's system control has them."""
        (self.write if self.device == "f28335" else self.write32)(address, value)

    def poke(self, name, value, leg=0):
        """Set a word as the hardware does, without any protection."""
        self.word(self.address(name, leg))[0] = value

    def eallow(self, on=1):
        lib.ht_regfile_eallow(self.rf, on)

    def trip(self):
        for leg in range(6):
            self.poke("TZFLG", OST, leg)

    @property
    def said(self):
        """The kinds of the violations so far. The list is cleared."""
        log = [self.rf.log[n].kind for n in range(self.rf.violations)]
        self.rf.violations = 0
        return log


@pytest.fixture(params=CHIPS)
def chip(request):
    return Chip(request.param)


# --- what holds for every register ----------------------------------------------------


def test_reset_state(chip):
    for leg in range(6):
        assert chip.read("TBCTL", leg) == 0x0083  # frozen, clock halved
        assert chip.read("TZFLG", leg) == 0
    assert chip.read("TBPRD") == 0
    # No pull-ups on the PWM's pins (F28335), on any (F28377S).
    assert chip.read32("GPAPUD") == (0x00000FFF if chip.device == "f28335" else 0xFFFFFFFF)
    if chip.device == "f28377s":
        assert chip.read32(0x5D226) == 0x51  # PERCLKDIVSEL: ePWM and EMIFs halved
        assert chip.read32(0x5D22C) == 2  # LOSPCP
    else:
        assert chip.read(0x701B) == 2
    assert chip.rf.violations == 0


def test_plain_register_keeps_what_is_written(chip):
    for leg in range(6):
        chip.write("CMPA", 1000 + leg, leg)
        chip.write("CMPA", 2000 + leg, leg)
    assert [chip.read("CMPA", leg) for leg in range(6)] == list(range(2000, 2006))
    assert (chip.rf.violations, chip.rf.accesses) == (0, 18)


@pytest.mark.parametrize("leg", (0, 5))
@pytest.mark.parametrize("name", PROTECTED)
def test_trip_zone_needs_eallow(chip, name, leg):
    chip.trip()
    chip.poke("TZFLG", 0, leg)
    chip.write(name, OST, leg)
    assert (chip.rf.first_address, chip.rf.first_kind) == (chip.address(name, leg), NO_EALLOW)
    assert chip.said == [NO_EALLOW]
    assert chip.read(name, leg) == 0
    assert chip.read("TZFLG", leg) == 0  # a force without EALLOW trips nothing
    chip.trip()
    chip.eallow()
    chip.write(name, OST if name != "TZSEL" else 0x0100, leg)
    assert not chip.rf.violations
    chip.eallow(0)
    chip.write(name, OST, leg)
    assert chip.said == [NO_EALLOW]


@pytest.mark.parametrize("device", CHIPS)
def test_system_registers_need_eallow(device):
    chip = Chip(device, clocked=False)
    for address, bits in CLOCKS[device].items():
        before = chip.word(address)[0]
        chip.change(address, bits)
        assert chip.word(address)[0] == before
        assert chip.said == [NO_EALLOW]
        chip.eallow()
        chip.change(address, bits)
        assert chip.word(address)[0] == bits
        chip.eallow(0)
    chip.write32("GPAMUX1", 0)
    assert chip.said == [NO_EALLOW]
    chip.write32(0x0D40, 0)  # PIE vectors
    assert chip.said == [NO_EALLOW]


def test_force_and_clear_of_the_trip_flag(chip):
    chip.eallow()
    chip.write("TZFRC", OST, 2)
    assert chip.read("TZFLG", 2) == OST
    chip.write("TZEINT", OST, 2)
    chip.write("TZFRC", OST, 2)
    assert chip.read("TZFLG", 2) == OST | INT  # only a trip that may interrupt
    assert chip.read("TZFRC", 2) == 0  # reads back zero
    assert [chip.read("TZFLG", leg) for leg in (0, 1, 3, 4, 5)] == [0] * 5
    chip.write("TZCLR", 0, 2)
    assert chip.read("TZFLG", 2) == OST | INT  # zeros clear nothing
    chip.write("TZCLR", INT, 2)
    assert chip.read("TZFLG", 2) == OST
    chip.write("TZCLR", OST, 2)
    assert chip.read("TZFLG", 2) == 0
    assert chip.rf.violations == 0


def test_trip_flag_is_read_only(chip):
    chip.eallow()
    chip.write("TZFRC", OST)
    chip.write("TZFLG", 0)
    assert chip.read("TZFLG") == OST
    assert (chip.rf.first_address, chip.rf.first_kind) == (chip.address("TZFLG"), READ_ONLY)


def test_event_flag_is_cleared_by_ones(chip):
    chip.poke("ETFLG", 0x0005)
    chip.write("ETCLR", 0x0001)
    assert chip.read("ETFLG") == 0x0004
    assert chip.read("ETCLR") == 0
    assert chip.rf.violations == 0


def test_pieack_is_cleared_by_ones(chip):
    chip.poke(PIEACK, 0x0FFF)
    chip.write(PIEACK, 0x0004)
    assert chip.read(PIEACK) == 0x0FFB


@pytest.mark.parametrize("bit", range(16))
def test_reserved_bits_stay_and_a_write_is_reported(chip, bit):
    """AQCTLA has 12 bits. A value that was read may be written back."""
    chip.write("AQCTLA", 1 << bit)
    assert chip.read("AQCTLA") == (1 << bit) & 0x0FFF
    assert chip.said == ([RESERVED] if bit > 11 else [])
    chip.poke("AQCTLA", 0x8000)
    chip.write("AQCTLA", 0x8000 | (1 << bit & 0x0FFF))
    assert chip.read("AQCTLA") == 0x8000 | (1 << bit & 0x0FFF)
    assert not chip.said


def test_access_width(chip):
    chip.eallow()
    for address in (chip.at["GPAMUX1"], chip.at["GPAMUX1"] + 1, chip.at["eqep"], 0x0C02):
        chip.write(address, 0x0010)
        assert chip.said == [WIDTH]
        assert chip.word(address)[0] == Chip(chip.device).word(address)[0]  # nothing came of it
        chip.read(address)
        assert chip.said == [WIDTH]
    chip.write32("CMPA", 0x12345678)
    chip.read32("CMPA")
    assert chip.said == [WIDTH, WIDTH]
    assert chip.word(chip.at["CMPA"])[0] == 0


def test_32_bit_accesses_are_low_word_first(chip):
    address = chip.at["eqep"]
    chip.write32(address, 0x89AB4567)
    assert (chip.word(address)[0], chip.word(address)[1]) == (0x4567, 0x89AB)
    assert chip.read32(address) == 0x89AB4567


@pytest.mark.parametrize(
    "address", (0x0050, 0x7FFF, 0x8000, 0x5CFFF, 0x5D000, 0x5D800, 0x380080, 0xFFFFFFFF)
)
def test_no_such_register(chip, address):
    assert chip.read(address) == 0
    assert (chip.rf.violations, chip.rf.first_kind, chip.rf.first_address) == (1, HOLE, address)
    chip.write(address, 1)
    assert chip.rf.violations == 2


def test_first_violations_are_kept(chip):
    chip.write("TZFRC", OST)
    for _ in range(40):
        chip.read(0x8000)
    assert (chip.rf.first_address, chip.rf.first_kind) == (chip.address("TZFRC"), NO_EALLOW)
    assert chip.rf.violations == 41
    assert chip.rf.log[0].kind == NO_EALLOW
    assert chip.rf.log[15].address == 0x8000


def test_eallow_twice_is_reported(chip):
    chip.eallow()
    assert not chip.said
    chip.eallow()
    assert chip.said == [ORDER]
    chip.eallow(0)
    chip.eallow()
    assert not chip.said


def test_names(chip):
    name = ffi.new("char[64]")
    for leg in (0, 5):
        lib.ht_regfile_name(chip.rf, chip.address("TZFRC", leg), name)
        assert ffi.string(name) == f"EPWM{leg + 1}.TZFRC".encode()
    lib.ht_regfile_name(chip.rf, 0x0D40, name)
    assert ffi.string(name) == b"VECTOR32"
    lib.ht_regfile_name(chip.rf, 0x8000, name)
    assert ffi.string(name) == b""


# --- clocks ---------------------------------------------------------------------------


@pytest.mark.parametrize("device", CHIPS)
def test_module_without_clock(device):
    """Writes are lost until the enable bit has been set and has settled; each module has
    its own bit."""
    chip = Chip(device, clocked=False)
    register = next(iter(CLOCKS[device]))  # of the ePWMs
    chip.eallow()
    chip.write("CMPA", 5, 2)
    chip.change(register, 0b000100)  # ePWM3
    chip.write("CMPA", 6, 2)
    assert chip.said == [UNCLOCKED, UNCLOCKED]
    lib.ht_regfile_settle(chip.rf)
    assert chip.read("CMPA", 2) == 0
    chip.write("CMPA", 7, 2)
    assert chip.read("CMPA", 2) == 7
    assert not chip.said
    for leg in (0, 1, 3, 4, 5):
        chip.write("CMPA", 7, leg)
    assert chip.said == [UNCLOCKED] * 5
    chip.change(register, 0)
    lib.ht_regfile_settle(chip.rf)
    chip.write("CMPA", 8, 2)
    assert chip.said == [UNCLOCKED]
    for address in (chip.at["eqep"] + 0x14, chip.at["sci"]):
        chip.write(address, 0)
        assert chip.said == [UNCLOCKED]


#: Registers of the PWM that are set up once.
ONCE = ("TBCTL", "TBPRD", "DBCTL")


def test_pwm_is_set_up_while_tripped(chip):
    for name in ONCE:
        chip.write(name, 0)
        assert chip.said == [ORDER]
    chip.trip()
    for name in ONCE:
        chip.write(name, 0)
    assert not chip.said


def test_pwm_is_set_up_with_the_counters_stopped(chip):
    address, bit = TBCLKSYNC[chip.device]
    chip.trip()
    chip.eallow()
    chip.change(address, chip.word(address)[0] | bit)
    for name in (*ONCE, "TZCTL"):
        chip.write(name, 0)
        assert chip.said == [ORDER]
    for name in ("CMPA", "AQCTLA"):  # what changes every period
        chip.write(name, 0x0330)
    assert not chip.said


def test_pll_of_the_f28335():
    chip = Chip("f28335")
    pllsts, pllcr = 0x7011, 0x7021
    chip.eallow()
    chip.write(pllcr, 10)
    assert chip.said == [ORDER]  # MCLKOFF first
    chip = Chip("f28335")
    chip.eallow()
    chip.write(pllsts, 0x0100)
    chip.write(pllsts, 0x0140)
    chip.write(pllcr, 10)
    assert (chip.said, chip.read(pllcr)) == ([ORDER], 0)  # DIVSEL is not 0
    chip.write(pllsts, 0x0040)
    chip.write(pllcr, 10)
    assert not chip.said
    chip.write(pllsts, 0x0100)
    assert chip.said == [ORDER]  # not locked
    looks = 0
    while not chip.read(pllsts) & 1:
        looks += 1
    assert looks > 0
    chip.write(pllsts, 0x0100)
    assert not chip.said
    assert chip.read(pllsts) == 0x0101


def test_pll_of_the_f28377s():
    chip = Chip("f28377s")
    source, control, multiplier, status = 0x5D208, 0x5D20E, 0x5D214, 0x5D216
    chip.eallow()
    chip.write32(source, 0x11)
    assert chip.said == [ORDER]  # a crystal that is off
    chip.write32(source, 0x01)
    chip.write32(control, 0x3)
    assert chip.said == [ORDER]  # not locked
    chip.write32(control, 0)
    assert chip.said == [ORDER]  # stopped while selected
    chip.write32(multiplier, 20)
    assert chip.read32(control) == 1  # the write starts the PLL
    looks = 0
    while not chip.read32(status) & 1:
        looks += 1
    assert looks > 0
    chip.write32(control, 3)
    assert not chip.said
    chip.write32(multiplier, 40)
    chip.write32(source, 0)
    assert chip.said == [ORDER, ORDER]
    chip.write32(status, 1)
    assert chip.said == [READ_ONLY]


# --- watchdog ---------------------------------------------------------------------------

WDKEY, WDCR = 0x7025, 0x7029


def test_watchdog_keys(chip):
    chip.write(WDKEY, 0x55)
    assert chip.said == [NO_EALLOW]
    chip.eallow()
    for keys, services in (
        ((0xAA,), 0), ((0x55,), 0), ((0x55, 0xAA), 1), ((0xAA, 0x55), 0), ((0xAA,), 1),
    ):  # fmt: skip
        before = chip.rf.dog_services
        for key in keys:
            chip.write(WDKEY, key)
        assert chip.rf.dog_services - before == services
    chip.write(WDKEY, 0x55)
    chip.write(WDKEY, 0x32)
    chip.write(WDKEY, 0xAA)
    assert chip.said == [KEY]
    assert chip.rf.dog_services == 2


def test_watchdog_control(chip):
    chip.eallow()
    for value in (0x0000, 0x0068 & ~0x20, 0x0010, 0x007F):
        chip.write(WDCR, value)
        assert chip.said == [KEY]  # WDCHK is not 101: reset
    chip.write(WDCR, 0x002F)
    assert not chip.said
    assert chip.read(WDCR) == 0x0007


def test_the_watchdogs_flag_of_the_f28335_is_cleared_by_a_one():
    """WDCR's WDFLAG, whose writes need WDCHK as well. No write sets it."""
    chip = Chip("f28335")
    chip.eallow()
    chip.word(WDCR)[0] |= 0x80
    for value, left in ((0x2F, 0x87), (0xAF, 0x07), (0xAF, 0x07)):
        chip.write(WDCR, value)
        assert chip.read(WDCR) == left
    assert not chip.said


def test_flags_of_a_reset_of_the_f28377s_are_cleared_by_ones():
    """RESC."""
    chip = Chip("f28377s")
    chip.eallow()
    assert chip.word(0x5D380)[0] == 3
    chip.word(0x5D380)[0] = 0x16F
    for ones, left in ((0, 0x16F), (4, 0x16B), (0x16B, 0)):
        chip.write32(0x5D380, ones)
        assert chip.read32(0x5D380) == left
    assert not chip.said


@pytest.mark.parametrize("wdps", range(8))
def test_watchdog_time(chip, wdps):
    """256 counts of the clock / 512 / prescaler, which is 1 for 0 and 1, then doubles."""
    clock = {"f28335": 30e6, "f28377s": 10e6}[chip.device]
    limit_us = 256 * 512 / clock * (1, 1, 2, 4, 8, 16, 32, 64)[wdps] * 1e6
    chip.eallow()
    chip.write(WDCR, 0x28 | wdps)
    chip.write(WDKEY, 0x55)
    chip.write(WDKEY, 0xAA)

    def wait(us):
        while us > 0:
            lib.ht_regfile_wait(chip.rf, min(60000, us))
            us -= 60000

    wait(int(limit_us) - 2)
    chip.write(WDKEY, 0x55)
    chip.write(WDKEY, 0xAA)
    wait(int(limit_us) - 2)
    assert not chip.said
    wait(4)
    assert (chip.said, chip.rf.dog_resets) == ([WATCHDOG], 1)
    chip.write(WDCR, 0x68)  # off
    wait(int(2 * limit_us))
    assert not chip.said


# --- pins, flash, calibration ---------------------------------------------------------------


def ready_for_pins(chip):
    for leg in range(6):
        chip.poke("TZFLG", OST, leg)
        chip.poke("TZCTL", 0x000A, leg)
        chip.poke("DBCTL", 0x000B, leg)
        chip.poke("DBRED", 100, leg)
        chip.poke("DBFED", 100, leg)
    chip.rf.eallow = 1


def test_pin_to_the_pwm_only_when_it_is_safe(chip):
    ready_for_pins(chip)
    chip.write32("GPAMUX1", 0x00555555)
    assert not chip.said
    chip.write32("GPAMUX1", 0)
    for name in ("TZFLG", "TZCTL", "DBCTL", "DBRED", "DBFED"):
        ready_for_pins(chip)
        chip.poke(name, 0, 4)
        for pin in range(12):
            chip.write32("GPAMUX1", 1 << 2 * pin)
            assert chip.said == ([ORDER] if pin // 2 == 4 else [])
            chip.write32("GPAMUX1", 0)
    other = Chip(chip.device, clocked=False)
    ready_for_pins(other)
    other.write32("GPAMUX1", 1)
    assert other.said == [ORDER]


@pytest.mark.parametrize("active_low", (0, 1))
def test_pin_to_the_pwm_wants_the_polarity_of_the_gate_drivers(chip, active_low):
    ready_for_pins(chip)
    chip.rf.gates_active_low = active_low
    for trip, dead_band, fits in (
        (0x000A, 0x000B, not active_low), (0x0005, 0x0007, active_low),
        (0x000A, 0x0007, False), (0x0005, 0x000B, False), (0x0000, 0x000B, False),
        (0x000A, 0x0000, False), (0x0005, 0x0003, False), (0x0005, 0x000F, False),
    ):  # fmt: skip
        chip.poke("TZCTL", trip, 3)
        chip.poke("DBCTL", dead_band, 3)
        chip.write32("GPAMUX1", 0x1000)  # GPIO6 to ePWM4
        assert chip.said == ([] if fits else [ORDER])
        chip.write32("GPAMUX1", 0)


@pytest.mark.parametrize("active_low", (0, 1))
def test_what_a_trip_does_while_the_counters_run(chip, active_low):
    """Both off at any time; the lower switch, output B, on at a module that is tripped. Nothing
    else, and a leg is not released as long as its next trip would switch on."""
    ready_for_pins(chip)
    chip.rf.gates_active_low = active_low
    for leg in range(6):
        chip.poke("DBCTL", 0x0007 if active_low else 0x000B, leg)
    off, lower = (0x0005, 0x0009) if active_low else (0x000A, 0x0006)
    chip.poke("TZCTL", off)
    chip.write32("GPAMUX1", 0)
    address, bit = TBCLKSYNC[chip.device]
    chip.change(address, chip.word(address)[0] | bit)
    chip.write("TZCTL", off)
    chip.write("TZCTL", lower)
    assert not chip.said
    for others in set(range(16)) - {off, lower}:
        chip.write("TZCTL", others)
        assert chip.said == [ORDER]
    chip.poke("TZCTL", lower)
    chip.write32("GPAMUX1", 0x00555555)
    assert ORDER in chip.said
    chip.write("TZCLR", OST)
    assert chip.said == [ORDER]
    chip.poke("TZFLG", 0)
    chip.write("TZCTL", lower)
    assert chip.said == [ORDER]
    chip.write("TZCTL", off)
    assert not chip.said
    if chip.device == "f28377s":
        chip.poke("TZFLG", OST)
        chip.write("TZCTL", 0x0200 | off)  # what the comparators do
        assert chip.said == [ORDER]


@pytest.mark.parametrize("name", ("DBRED", "DBFED"))
def test_no_dead_time_at_a_module_with_pins(chip, name):
    """While it is tripped, the write is reported, and so is a release of the trip."""
    ready_for_pins(chip)
    chip.write32("GPAMUX1", 0x00555555)
    chip.write(name, 200, 2)
    assert not chip.said
    chip.write(name, 0, 2)
    assert chip.said == [ORDER]
    for leg in range(6):
        chip.write("TZCLR", OST, leg)
        assert chip.said == ([ORDER] if leg == 2 else [])
        chip.poke("TZFLG", OST, leg)
    chip.write(name, 200, 2)
    chip.write("DBCTL", 0, 2)  # bypassed
    chip.write("TZCLR", OST, 2)
    assert chip.said == [ORDER, ORDER]


def test_no_dead_time_at_a_module_without_pins(chip):
    """Nothing follows it, so it may be set up in any order; released without a dead time, with
    complementary outputs, it is told."""
    chip.trip()
    chip.eallow()
    chip.write("DBCTL", 0x000B)
    chip.write("DBRED", 0)
    assert not chip.said
    chip.write("TZCLR", OST)
    assert chip.said == [ORDER]


def test_pin_groups_of_the_f28377s():
    """GMUX before MUX: with GPIO16 at position 1 the group makes it another function."""
    chip = Chip("f28377s")
    mux2, gmux2 = 0x7C08, 0x7C22
    chip.eallow()
    chip.write32(gmux2, 1)
    chip.write32(gmux2, 0)
    assert not chip.said
    chip.write32(mux2, 1)
    chip.write32(gmux2, 1)
    assert chip.said == [ORDER]
    # position 5 of GPIO16 is EPWM9A, which has no clock here
    chip.write32(mux2, 0)
    chip.write32(gmux2, 1)
    chip.write32(mux2, 1)
    assert chip.said == [ORDER]


def test_flash_pump_of_the_f28377s():
    chip = Chip("f28377s")
    request, fbac, rdcntl, interface = 0x50024, 0x5F81E, 0x5F800, 0x5F980
    chip.eallow()
    chip.write32(fbac, 0x14)
    assert chip.said == [ORDER]
    chip.write32(request, 2)
    assert chip.said == [KEY]
    chip.write32(request, 0x5A5A0002)
    chip.write32(interface, 3)
    assert not chip.said
    chip.write32(rdcntl, 0x300)
    assert chip.said == [ORDER]
    chip.write32(interface, 0)
    chip.write32(rdcntl, 0x300)
    assert not chip.said


def test_functions_in_otp(chip):
    call = lib.ht_regfile_call
    if chip.device == "f28335":
        call(chip.rf, 0x380080, 0)
        assert chip.word(0x711C)[0] != 0  # ADCREFSEL
    else:
        call(chip.rf, 0x0703B4, 0)
        assert chip.said == [NO_EALLOW]
        chip.eallow()
        call(chip.rf, 0x0703B4, 0)
        assert chip.read32(0x7470) != 0  # ADCINLTRIM1
        assert call(chip.rf, 0x0703AC, 0) != 0
        assert call(chip.rf, 0x0703B2, 0) == 0  # the same for ADC-B, which has no clock
        assert chip.said == [NO_EALLOW]
    assert not chip.said
    call(chip.rf, 0x123456, 0)
    assert chip.said == [HOLE]


# --- encoder interface ---------------------------------------------------------------------

#: eQEP: what only the hardware changes.
QCAPCTL, QFLG, QEPSTS, QCTMR, QCPRD, QCTMRLAT, QCPRDLAT = 0x16, 0x19, 0x1C, 0x1D, 0x1E, 0x1F, 0x20


def test_encoder_registers_are_zero_after_reset(chip):
    assert [chip.word(chip.at["eqep"] + n)[0] for n in range(0x21)] == [0] * 0x21


@pytest.mark.parametrize("offset", (QFLG, QCTMR, QCPRD, QCTMRLAT, QCPRDLAT))
def test_encoder_results_are_read_only(chip, offset):
    address = chip.at["eqep"] + offset
    chip.poke(address, 1234)
    chip.write(address, 1)
    assert chip.read(address) == 1234
    assert (chip.rf.violations, chip.rf.first_kind) == (1, READ_ONLY)
    assert chip.rf.first_address == address


@pytest.mark.parametrize("offset", (0x08, 0x0A, 0x0C))  # QPOSILAT, QPOSSLAT, QPOSLAT
def test_encoder_latches_are_read_only(chip, offset):
    chip.write32(chip.at["eqep"] + offset, 1)
    assert chip.said == [READ_ONLY]
    assert chip.read32(chip.at["eqep"] + offset) == 0


def test_other_encoder_registers_keep_what_is_written(chip):
    base = chip.at["eqep"]
    for offset in (0x00, 0x02, 0x04, 0x06, 0x0E, 0x10):
        chip.write32(base + offset, 0x12345678 ^ offset)
        assert chip.read32(base + offset) == 0x12345678 ^ offset
    for offset, value in ((0x12, 0xABCD), (0x13, 1), (0x14, 0xFFE0), (0x15, 0x9008), (0x18, 2)):
        chip.write(base + offset, value)
        assert chip.read(base + offset) == value
    assert chip.rf.violations == 0


def test_capture_prescalers_change_while_it_is_off(chip):
    control = chip.at["eqep"] + QCAPCTL
    for value in (0x0072, 0x8072, 0x0072, 0x0013, 0x8013):
        chip.write(control, value)
    assert not chip.said
    chip.write(control, 0x8072)
    assert chip.said == [ORDER]


def test_encoder_status_is_cleared_by_ones(chip):
    """UPEVNT, COEF, CDEF, FIMF; the directions and the error flag follow the hardware."""
    status = chip.at["eqep"] + QEPSTS
    chip.poke(status, 0x00FF)
    chip.write(status, 0)
    assert chip.read(status) == 0x00FF
    for bit, left in ((0x80, 0x7F), (0x08, 0x77), (0x04, 0x73), (0x02, 0x71)):
        chip.write(status, bit)
        assert chip.read(status) == left
    assert chip.rf.violations == 0
    chip.write(status, 0xFFFF)
    assert chip.read(status) == 0x71
    assert chip.said == [RESERVED]


# --- SCI ------------------------------------------------------------------------------

SCICCR, SCICTL1, SCIRXST, SCIRXBUF, SCITXBUF, SCIFFTX, SCIFFRX = 0, 1, 5, 7, 9, 10, 11


def running_sci(chip):
    base = chip.at["sci"]
    chip.write(base + SCIFFTX, 0xE000)
    chip.write(base + SCIFFRX, 0x2000)
    chip.write(base + SCICTL1, 0x0023)
    return base


def test_sci_format_changes_in_software_reset(chip):
    base = chip.at["sci"]
    chip.write(base + SCICCR, 7)
    assert not chip.said
    running_sci(chip)
    for offset in (SCICCR, 2, 3):  # and both halves of the divider
        chip.write(base + offset, 1)
        assert chip.said == [ORDER]


def test_sci_transmit_fifo(chip):
    base = running_sci(chip)
    for n in range(16):
        chip.write(base + SCITXBUF, 200 + n)
    assert chip.read(base + SCIFFTX) == 0xE000 | 16 << 8
    assert not chip.said
    chip.write(base + SCITXBUF, 1)
    assert chip.said == [ORDER]
    assert [lib.ht_regfile_sci_leave(chip.rf) for _ in range(17)] == [*range(200, 216), 0xFFFF]


def test_sci_receive_fifo(chip):
    base = running_sci(chip)
    for n in range(16):
        assert lib.ht_regfile_sci_arrive(chip.rf, 100 + n)
    assert not lib.ht_regfile_sci_arrive(chip.rf, 1)
    assert chip.read(base + SCIFFRX) == 0x8000 | 0x2000 | 16 << 8  # overflow, level
    assert [chip.read(base + SCIRXBUF) for _ in range(3)] == [100, 101, 102]
    assert chip.read(base + SCIFFRX) >> 8 & 0x1F == 13
    chip.write(base + SCIFFRX, 0x6000)  # clears the overflow
    assert chip.read(base + SCIFFRX) == 0x2000 | 13 << 8
    chip.write(base + SCIFFRX, 0)  # reset empties
    chip.write(base + SCIFFRX, 0x2000)
    assert chip.read(base + SCIFFRX) == 0x2000
    assert not chip.said


def test_sci_receiver_stops_at_an_error(chip):
    base = running_sci(chip)
    chip.poke(base + SCIRXST, 0x0090)  # framing error
    assert not lib.ht_regfile_sci_arrive(chip.rf, 1)
    chip.write(base + SCICTL1, 0x0003)  # software reset: clears the error, receives nothing
    assert chip.read(base + SCIRXST) == 0
    assert not lib.ht_regfile_sci_arrive(chip.rf, 1)
    chip.write(base + SCICTL1, 0x0023)
    assert lib.ht_regfile_sci_arrive(chip.rf, 1)


# --- timer, interrupts --------------------------------------------------------------------

PIECTRL, PIEIER1, PIEIFR1, TCR, PRD = 0x0CE0, 0x0CE2, 0x0CE3, 0x0C04, 0x0C02


def test_timer_control(chip):
    chip.write32(PRD, 1999999)
    chip.write(TCR, 0x0030)
    assert chip.read32(0x0C00) == 1999999  # TRB loads the counter
    assert chip.read(TCR) == 0x0010  # and reads 0
    assert not lib.ht_regfile_timer(chip.rf)  # stopped
    chip.write(TCR, 0x4000)
    assert lib.ht_regfile_timer(chip.rf)
    assert chip.read(TCR) == 0xC000
    chip.write(TCR, 0xC000)
    assert chip.read(TCR) == 0x4000  # TIF is cleared by 1


class Interrupts:
    """Timer and ADC interrupts into Python."""

    def __init__(self, chip):
        self.chip, self.calls, self.within = chip, [], lambda: None
        self._keep = [ffi.callback("void(void)", f) for f in (self.fast, self.slow)]
        chip.eallow()
        for vector, function in zip((32, 38), self._keep):
            lib.ht_regfile_vector(chip.rf, 0x0D00 + 2 * vector, function)
        chip.eallow(0)
        chip.write(PIECTRL, 1)
        chip.write(PIEIER1, 0x0041)
        chip.write(TCR, 0x4000)
        lib.ht_regfile_ier(chip.rf, 1)
        # interrupt at the end of a sequence: INT_ENA_SEQ1, or INT1E with EOC3
        chip.eallow()
        chip.write(*((0x7101, 0x0800) if chip.device == "f28335" else (0x7407, 0x0023)))
        chip.eallow(0)

    def fast(self):
        self.calls.append("fast")
        self.chip.write(*((0x7119, 0x0010) if self.chip.device == "f28335" else (0x7404, 1)))
        self.chip.write(PIEACK, 1)

    def slow(self):
        self.calls.append("slow")
        self.within()
        self.chip.write(PIEACK, 1)

    def timer(self):
        lib.ht_regfile_timer(self.chip.rf)

    def adc(self):
        lib.ht_regfile_end_of_sequence(self.chip.rf)


def test_interrupts_wait_for_the_mask_and_come_in_order(chip):
    it = Interrupts(chip)
    it.timer()
    it.adc()
    assert not it.calls
    lib.ht_regfile_intm(chip.rf, 0)
    assert it.calls == ["fast", "slow"]  # the lower line first
    assert (chip.rf.intm, chip.rf.ier, chip.rf.word[PIEIFR1]) == (0, 1, 0)


@pytest.mark.parametrize("missing", ("PIECTRL", "PIEIER1", "IER", "acknowledge", "flag"))
def test_what_an_interrupt_needs(chip, missing):
    it = Interrupts(chip)
    lib.ht_regfile_intm(chip.rf, 0)
    if missing == "PIECTRL":
        chip.write(PIECTRL, 0)
    elif missing == "PIEIER1":
        chip.write(PIEIER1, 0x0040)
    elif missing == "IER":
        lib.ht_regfile_ier(chip.rf, 0)
    elif missing == "acknowledge":
        chip.poke(PIEACK, 1)
    else:  # the flag of the sequence before has not been cleared
        chip.poke(0x7119 if chip.device == "f28335" else 0x7403, 1)
    it.adc()
    assert not it.calls


def test_adc_interrupt_at_the_clear_of_its_flag():
    """Errata SPRZ422, "Interrupts may Stop if INTxCONT is not Set": the end of a conversion in
    the instant of the clear keeps the flag set and the overflow as well; from then on no
    interrupt comes, unless INT1CONT lets them through whatever the flag says."""
    for cont, still in ((0, 0), (0x40, 3)):
        chip = Chip("f28377s")
        it = Interrupts(chip)
        chip.eallow()
        chip.write(0x7407, 0x0023 | cont)
        chip.eallow(0)
        it.adc()
        chip.rf.event_at = chip.rf.accesses + 1
        chip.write(0x7404, 1)
        assert (chip.read(0x7403), chip.read(0x7405)) == (1, 1)
        chip.rf.word[PIEIFR1] = 0
        lib.ht_regfile_intm(chip.rf, 0)
        it.fast = lambda: None
        for _ in range(3):
            it.adc()
        assert it.calls.count("fast") == still
        # a second clear, and one of the overflow, which does not go by itself
        chip.write(0x7404, 1)
        assert (chip.read(0x7403), chip.read(0x7405)) == (0, 1)
        chip.write(0x7406, 1)
        assert chip.read(0x7405) == 0
        assert not chip.said


def test_clear_of_the_adc_flag_at_another_time_clears_it():
    chip = Chip("f28377s")
    it = Interrupts(chip)
    it.adc()
    chip.write(0x7404, 1)
    assert (chip.read(0x7403), chip.read(0x7405)) == (0, 0)
    it.adc()
    it.adc()  # nobody has cleared in between
    assert (chip.read(0x7403), chip.read(0x7405)) == (1, 1)


def test_eint_right_after_pieack_is_reported(chip):
    """Usage note of both chips' errata."""
    it = Interrupts(chip)
    chip.write(PIEACK, 1)
    lib.ht_regfile_ier(chip.rf, 1)
    lib.ht_regfile_intm(chip.rf, 0)
    assert chip.said == [ORDER]
    lib.ht_regfile_intm(chip.rf, 1)
    chip.write(PIEACK, 1)
    lib.ht_regfile_nop(chip.rf)
    lib.ht_regfile_intm(chip.rf, 0)
    assert not chip.said
    assert not it.calls


def test_global_load_control_needs_eallow():
    chip = Chip("f28377s")
    chip.write(0x4034, 1)
    assert chip.said == [NO_EALLOW]
    chip.eallow()
    chip.write(0x4034, 1)
    assert chip.read(0x4034) == 1
    assert not chip.said


def test_cpu_timers_1_and_2_count_their_clocks():
    """Timer 2 on the crystal, timer 1 on SYSCLK: the ratio is the PLL's."""
    chip = Chip("f28377s")
    chip.word(0x5D322)[0] |= 0x30
    lib.ht_regfile_settle(chip.rf)
    chip.eallow()
    chip.write32(0x5D208, 1)  # crystal
    chip.write32(0x5D214, 20)
    while not chip.read32(0x5D216) & 1:
        pass
    chip.write32(0x5D222, 2)  # a quarter
    chip.write32(0x5D20E, 3)
    chip.write32(0x5D37C, 3)  # TMR2CLKCTL: XTAL
    for timer, first in ((0x0C08, 0xFFFFFFFF), (0x0C10, 999)):
        chip.write32(timer + 2, first)
        chip.write(timer + 4, 0x0030)
        chip.write(timer + 4, 0)
    looks = 0
    while not chip.read(0x0C14) & 0x8000:
        looks += 1
    assert looks > 10
    chip.write(0x0C0C, 0x0010)
    counts = 0xFFFFFFFF - chip.read32(0x0C08)
    assert counts / 1000 == pytest.approx(5, rel=0.02)
    assert counts == 0xFFFFFFFF - chip.read32(0x0C08)  # it stands
    chip.write(0x0C14, 0x8010)
    assert not chip.read(0x0C14) & 0x8000
    assert not chip.said


def test_fast_interrupt_within_the_slow_one(chip):
    it = Interrupts(chip)
    lib.ht_regfile_intm(chip.rf, 0)

    def within():
        it.adc()
        it.calls.append("masked")
        chip.write(PIEIER1, 0x0001)
        chip.write(PIEACK, 1)
        lib.ht_regfile_nop(chip.rf)
        lib.ht_regfile_ier(chip.rf, 1)
        lib.ht_regfile_intm(chip.rf, 0)
        it.calls.append("let in")
        lib.ht_regfile_intm(chip.rf, 1)
        chip.write(PIEIER1, 0x0041)

    it.within = within
    chip.eallow()
    it.timer()
    assert it.calls == ["slow", "masked", "fast", "let in"]
    assert (chip.rf.deepest, chip.rf.depth, chip.rf.eallow) == (2, 0, 1)  # restored


def test_interrupt_comes_between_two_accesses(chip):
    it = Interrupts(chip)
    lib.ht_regfile_intm(chip.rf, 0)
    chip.rf.event_at = chip.rf.accesses + 2
    chip.read("TBCTL")
    assert not it.calls
    chip.read("TBCTL")
    assert it.calls == ["fast"]


def test_sequencer_of_the_f28335_is_reset_between_sequences():
    """By RST_SEQ1. Otherwise the next sequence continues where the last one stopped."""
    chip = Chip("f28335")
    chip.trip()
    chip.eallow()
    for address, value in ((0x6819, 0x0900), (0x681A, 0x0100), (0x7100, 0x0010), (0x7102, 7)):
        chip.write(address, value)
    lib.ht_regfile_call(chip.rf, 0x380080, 0)
    chip.write(0x7118, 0x00E0)
    chip.write(0x7101, 0x0900)
    assert not lib.ht_regfile_period(chip.rf)  # the counters stand
    lib.ht_regfile_wait(chip.rf, 4000)
    chip.write(0x701C, 0x040C)
    assert chip.said == [ORDER]  # 5 ms from power-up to the first conversion
    assert lib.ht_regfile_period(chip.rf)
    chip.write(0x7101, 0x4900)
    assert lib.ht_regfile_period(chip.rf)
    assert not chip.said
    assert lib.ht_regfile_period(chip.rf)
    assert chip.said == [ORDER]


def test_the_trip_pin_trips_the_modules_that_select_it(chip):
    chip.trip()
    chip.eallow()
    for leg in (0, 2, 4):
        chip.write("TZSEL", 0x0100, leg)
    connect_the_trip_pin(chip)
    for leg in range(6):
        chip.poke("TZFLG", 0, leg)
    lib.ht_regfile_pin(chip.rf, 13, 0)  # another one
    assert [chip.read("TZFLG", leg) for leg in range(6)] == [0] * 6
    lib.ht_regfile_pin(chip.rf, 12, 0)
    assert [chip.read("TZFLG", leg) for leg in range(6)] == [OST, 0, OST, 0, OST, 0]


def connect_the_trip_pin(chip):
    """GPIO12: TZ1 by its multiplexer, or input 1 of the crossbar."""
    if chip.device == "f28335":
        chip.write32("GPAMUX1", 1 << 24)
    else:
        chip.write(0x7900, 12)


def test_a_cleared_trip_returns_while_its_pin_is_low(chip):
    """The pin's level counts, not an edge. A clear while the pin is low has no effect and is
    reported."""
    chip.trip()
    chip.eallow()
    lib.ht_regfile_pin(chip.rf, 12, 0)
    connect_the_trip_pin(chip)
    chip.poke("TZFLG", 0)
    chip.write("TZEINT", 0)
    assert chip.read("TZFLG") == 0  # nobody listens yet
    chip.write("TZSEL", 0x0100)
    assert chip.said == [ORDER]  # set up while not tripped
    assert chip.read("TZFLG") == OST
    chip.write("TZCLR", OST)
    assert (chip.said, chip.read("TZFLG")) == ([ORDER], OST)
    lib.ht_regfile_pin(chip.rf, 12, 1)
    assert chip.read("TZFLG") == OST
    chip.write("TZCLR", OST)
    assert (chip.said, chip.read("TZFLG")) == ([], 0)


def test_the_firmware_cannot_change_the_levels_of_input_pins(chip):
    data = {"f28335": 0x6FC0, "f28377s": 0x7F00}[chip.device]
    assert chip.read32(data) == 0xFFFFFFFF
    lib.ht_regfile_pin(chip.rf, 31, 0)
    assert chip.read32(data) == 0x7FFFFFFF
    chip.write32(data, 0)
    assert chip.said == [READ_ONLY]
    assert chip.read32(data) == 0x7FFFFFFF


def test_clock_failure_and_emulation_stop_trip_the_f28377s(chip):
    chip.trip()
    chip.eallow()
    for leg, sources in enumerate((0x1000, 0x2000, 0x3000, 0x0100, 0x0000, 0x0010)):
        chip.write("TZSEL", sources, leg)

    def tripped(event):
        for leg in range(6):
            chip.poke("TZFLG", 0, leg)
        event(chip.rf)
        return [leg for leg in range(6) if chip.read("TZFLG", leg) & OST]

    large = chip.device == "f28377s"  # on the F28335 these two are pins
    assert tripped(lib.ht_regfile_clock_fails) == ([0, 2] if large else [])
    assert tripped(lib.ht_regfile_emulation_stops) == ([1, 2] if large else [])
