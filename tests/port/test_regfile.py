"""The register model against what the reference manuals say about the chip:
EALLOW protection, write-1-to-clear, force and read-only registers, holes.
"""

import pytest

from hexatorque.firmware import ffi, lib

OST, INT = 0x0004, 0x0001
NO_EALLOW, HOLE, READ_ONLY = lib.HT_REG_NO_EALLOW, lib.HT_REG_HOLE, lib.HT_REG_READ_ONLY

#: Word addresses from TI's manuals, ePWM1, and the distance to the next module.
CHIPS = {
    "f28335": {
        "base": 0x6800, "stride": 0x40, "TBCTL": 0x6800, "TBPRD": 0x6805, "TZSEL": 0x6812,
        "TZCTL": 0x6814, "TZEINT": 0x6815, "TZFLG": 0x6816, "TZCLR": 0x6817, "TZFRC": 0x6818,
        "ETFLG": 0x681B, "ETCLR": 0x681C, "PCLKCR1": 0x701D, "PCLKCR0": 0x701C,
        "eqep": 0x6B00,
    },
    "f28377s": {
        "base": 0x4000, "stride": 0x100, "TBCTL": 0x4000, "TBPRD": 0x4063, "TZSEL": 0x4080,
        "TZCTL": 0x4084, "TZEINT": 0x408D, "TZFLG": 0x4093, "TZCLR": 0x4097, "TZFRC": 0x409B,
        "ETFLG": 0x40A8, "ETCLR": 0x40AA, "PCLKCR2": 0x5D326, "PCLKCR0": 0x5D323,
        "PERCLKDIVSEL": 0x5D226, "PCLKCR4": 0x5D32A, "eqep": 0x5100,
    },
}  # fmt: skip
PIEACK = 0x0CE1
PROTECTED = ("TZSEL", "TZCTL", "TZEINT", "TZCLR", "TZFRC")


class Chip:
    def __init__(self, device):
        self.at = CHIPS[device]
        self.rf = ffi.new("ht_regfile *")
        lib.ht_regfile_reset(self.rf, ffi.addressof(getattr(lib, f"ht_{device}")))

    def address(self, name, leg=0):
        return self.at[name] + leg * self.at["stride"] if isinstance(name, str) else name

    def read(self, name, leg=0):
        return lib.ht_regfile_read16(self.rf, self.address(name, leg))

    def write(self, name, value, leg=0):
        lib.ht_regfile_write16(self.rf, self.address(name, leg), value)

    def poke(self, name, value):
        """Set by hardware, past all protection."""
        self.rf.low[self.address(name)] = value

    def eallow(self, on):
        lib.ht_regfile_eallow(self.rf, on)


@pytest.fixture(params=CHIPS)
def chip(request):
    return Chip(request.param)


def test_reset_state(chip):
    for leg in range(6):
        assert chip.read("TBCTL", leg) == 0x0083  # frozen, clock halved
        assert chip.read("TZFLG", leg) == 0
    assert chip.read("TBPRD") == 0
    if "PERCLKDIVSEL" in chip.at:
        assert chip.read("PERCLKDIVSEL") == 0x51
    assert chip.rf.violations == 0


def test_plain_register_keeps_what_is_written(chip):
    for leg in range(6):
        chip.write("TBPRD", 1000 + leg, leg)
    assert [chip.read("TBPRD", leg) for leg in range(6)] == list(range(1000, 1006))
    assert (chip.rf.violations, chip.rf.accesses) == (0, 12)


@pytest.mark.parametrize("leg", (0, 5))
@pytest.mark.parametrize("name", PROTECTED)
def test_trip_zone_needs_eallow(chip, name, leg):
    chip.write(name, OST, leg)
    assert chip.rf.violations == 1
    assert (chip.rf.first_address, chip.rf.first_kind) == (chip.address(name, leg), NO_EALLOW)
    assert chip.read(name, leg) == 0
    assert chip.read("TZFLG", leg) == 0  # a force without EALLOW trips nothing
    chip.eallow(1)
    chip.write(name, OST, leg)
    assert chip.rf.violations == 1
    chip.eallow(0)
    chip.write(name, OST, leg)
    assert chip.rf.violations == 2


def test_system_registers_need_eallow(chip):
    names = [n for n in chip.at if n.startswith("P")]
    for count, name in enumerate(names, 1):
        before = chip.read(name)
        chip.write(name, before ^ 0x3F)
        assert chip.read(name) == before
        assert chip.rf.violations == count
    chip.eallow(1)
    for name in names:
        chip.write(name, 0x3F)
        assert chip.read(name) == 0x3F
    assert chip.rf.violations == len(names)


def test_force_and_clear_of_the_trip_flag(chip):
    chip.eallow(1)
    chip.write("TZFRC", OST, 2)
    assert chip.read("TZFLG", 2) == OST | INT
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
    chip.eallow(1)
    chip.write("TZFRC", OST)
    chip.write("TZFLG", 0)
    assert chip.read("TZFLG") == OST | INT
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


#: eQEP: what only the hardware changes.
QFLG, QEPSTS, QCTMR, QCPRD, QCTMRLAT, QCPRDLAT = 0x19, 0x1C, 0x1D, 0x1E, 0x1F, 0x20
LATCHES = range(0x08, 0x0E)  # QPOSILAT, QPOSSLAT, QPOSLAT, two words each


def test_encoder_registers_are_zero_after_reset(chip):
    assert [chip.read(chip.at["eqep"] + n) for n in range(0x21)] == [0] * 0x21
    assert chip.rf.violations == 0


@pytest.mark.parametrize("offset", (QFLG, QCTMR, QCPRD, QCTMRLAT, QCPRDLAT, *LATCHES))
def test_encoder_results_are_read_only(chip, offset):
    address = chip.at["eqep"] + offset
    chip.poke(address, 1234)
    chip.write(address, 1)
    assert chip.read(address) == 1234
    assert (chip.rf.violations, chip.rf.first_kind) == (1, READ_ONLY)
    assert chip.rf.first_address == address


def test_other_encoder_registers_keep_what_is_written(chip):
    fixed = (QFLG, QEPSTS, QCTMR, QCPRD, QCTMRLAT, QCPRDLAT, *LATCHES)
    plain = [chip.at["eqep"] + n for n in range(0x1B) if n not in fixed]
    for address in plain:
        chip.write(address, address ^ 0x5555)
    assert [chip.read(address) for address in plain] == [a ^ 0x5555 for a in plain]
    assert chip.rf.violations == 0


def test_encoder_status_is_cleared_by_ones(chip):
    """UPEVNT, COEF, CDEF, FIMF; the directions and the error flag follow the hardware."""
    status = chip.at["eqep"] + QEPSTS
    chip.poke(status, 0x00FF)
    chip.write(status, 0)
    assert chip.read(status) == 0x00FF
    for bit, left in ((0x80, 0x7F), (0x08, 0x77), (0x04, 0x73), (0x02, 0x71), (0xFFFF, 0x71)):
        chip.write(status, bit)
        assert chip.read(status) == left
    assert chip.rf.violations == 0


@pytest.mark.parametrize("address", (0x8000, 0x5CFFF, 0x5D800, 0xFFFFFFFF))
def test_holes(chip, address):
    assert chip.read(address) == 0
    assert (chip.rf.violations, chip.rf.first_kind, chip.rf.first_address) == (1, HOLE, address)
    chip.write(address, 1)
    assert chip.rf.violations == 2


def test_first_violation_is_kept(chip):
    chip.write("TZFRC", OST)
    chip.read(0x8000)
    assert (chip.rf.first_address, chip.rf.first_kind) == (chip.address("TZFRC"), NO_EALLOW)


def test_32_bit_accesses_are_low_word_first(chip):
    address = 0x5100 if "PERCLKDIVSEL" in chip.at else 0x6B00
    lib.ht_regfile_write32(chip.rf, address, 0x89AB4567)
    assert (chip.rf.low[address], chip.rf.low[address + 1]) == (0x4567, 0x89AB)
    assert lib.ht_regfile_read32(chip.rf, address) == 0x89AB4567
