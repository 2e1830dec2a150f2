"""Write the boards' pin tables, docs/data/pins-BOARD.csv, from the firmware's own tables.

`python tools/board_tables.py` (in an environment with hexatorque installed) also replaces the text
between a board's two marks in docs/first-spin.md. Signals, pins and channels come from `ht_board.c`
and from the registers after the drivers' start. Connector pins and remarks come from the lists
below. `tests/firmware/port/test_board_tables.py` checks that page and tables are current.
"""

import re
from pathlib import Path

import doc_page

from hexatorque.firmware import BOARDS, ffi, lib

PAGE = Path(__file__).resolve().parents[1] / "docs" / "first-spin.md"
LEGS = ("u1", "u2", "w1", "w2", "v1", "v2")
CURRENTS = tuple(f"current {leg}" for leg in LEGS)
ANALOGUE = (*CURRENTS, "dc link", "thermistor winding", "thermistor heat sink")

#: LAUNCHXL-F28377S: pins of its headers, as a public pin map of the board has them (that of
#: Energia's C2000 core). 1..10 are on J1, 11..20 on J2 and so on.
LAUNCHPAD = {
    2: "GPIO71", 3: "GPIO90", 4: "GPIO89", 5: "GPIO41", 7: "GPIO60", 8: "GPIO61",
    9: "GPIO43", 10: "GPIO42", 11: "GPIO78", 12: "GPIO73", 13: "GPIO72", 14: "GPIO59",
    15: "GPIO58", 18: "GPIO62", 19: "GPIO4", 23: "ADCIN14", 24: "ADCINB1", 25: "ADCINB4",
    26: "ADCINB2", 27: "ADCINA0", 28: "ADCINB0", 29: "ADCINA1", 33: "GPIO21", 34: "GPIO20",
    35: "GPIO17", 36: "GPIO16", 37: "GPIO15", 38: "GPIO14", 39: "GPIO13", 40: "GPIO12",
    43: "GPIO87", 44: "GPIO86", 47: "GPIO65", 49: "GPIO69", 50: "GPIO66", 52: "GPIO92",
    53: "GPIO99", 54: "GPIO64", 55: "GPIO63", 59: "GPIO91", 63: "ADCIN15", 64: "ADCINA2",
    65: "ADCINA5", 66: "ADCINB5", 67: "ADCINA3", 68: "ADCINB3", 69: "ADCINA4", 75: "GPIO19",
    76: "GPIO18", 77: "GPIO11", 78: "GPIO10", 79: "GPIO3", 80: "GPIO2",
}  # fmt: skip
#: F28335 controlCARD: pins of its 100-pin DIMM connector, as a public pin map has them.
DIMM100 = {
    7: "ADCINB0", 9: "ADCINB1", 11: "ADCINB2", 13: "ADCINB3", 15: "ADCINB4", 17: "ADCINB5",
    19: "ADCINB6", 21: "ADCINB7", 57: "ADCINA0", 59: "ADCINA1", 61: "ADCINA2", 63: "ADCINA3",
    65: "ADCINA4", 67: "ADCINA5", 69: "ADCINA6", 71: "ADCINA7", 23: "GPIO0", 73: "GPIO1",
    24: "GPIO2", 74: "GPIO3", 25: "GPIO4", 75: "GPIO5", 26: "GPIO6", 76: "GPIO7", 28: "GPIO8",
    78: "GPIO9", 29: "GPIO10", 79: "GPIO11", 33: "GPIO12", 83: "GPIO13", 84: "GPIO14",
    34: "GPIO15", 38: "GPIO16", 88: "GPIO17", 39: "GPIO18", 89: "GPIO19", 40: "GPIO20",
    90: "GPIO21", 41: "GPIO22", 91: "GPIO23", 43: "GPIO28", 93: "GPIO29", 31: "GPIO84",
    81: "GPIO85", 32: "GPIO86", 42: "GPIO87",
}  # fmt: skip
#: Board -> its connector's pins and what that column is called. Any other is the user's own board.
CONNECTORS = {"launchxl_f28377s": (LAUNCHPAD, "connector"), "f28335": (DIMM100, "card pin")}
#: Pins that are not on the headers but are connected to another part of the board.
ELSEWHERE = {
    "launchxl_f28377s": {"GPIO84": "the probe's COM port", "GPIO85": "the probe's COM port"}
}
REMARKS = {
    "launchxl_f28377s": {
        "GPIO62": "check with a meter: see below",
        "GPIO63": "check with a meter: see below",
        "ADCINA0": "50 kΩ to ground in the chip",
        "ADCINA1": "50 kΩ to ground in the chip",
        "ADCINB1": "50 kΩ to ground in the chip",
    },
    "f28377s": {
        "ADCINA0": "50 kΩ to ground in the chip",
        "ADCINA1": "50 kΩ to ground in the chip",
        "ADCINB1": "50 kΩ to ground in the chip",
    },
    "f28335": {
        **dict.fromkeys(("GPIO13", "GPIO14", "GPIO15", "GPIO16"), "pull-up on at reset: see below"),
        "GPIO28": "also the card's isolated RS-232 receiver: see below",
        "GPIO29": "also the card's isolated RS-232 driver (card pin 52)",
    },
}
ADC_A_SOC0, ADC_B_SOC0 = 0x7410, 0x7490  # F28377S


def connector(board: str, pin: str) -> str:
    """The board's connector pin for a pin of the device."""
    if board not in CONNECTORS:
        return "your board"
    pins, _ = CONNECTORS[board]
    (number,) = [n for n, name in pins.items() if name == pin] or [0]
    if not number:
        return ELSEWHERE.get(board, {}).get(pin, "not brought out")
    return f"J{(number - 1) // 10 + 1}.{number}" if pins is LAUNCHPAD else f"{number}"


def channels(board: str) -> list[str]:
    """The ADC inputs in the order of the samples: six currents, dc link, two thermistors."""
    table = getattr(lib, f"ht_board_{board}")
    wanted = [*table.channel, *table.slow_channel]
    if table.map.adc_sequencer:
        return [f"ADCIN{'AB'[c // 8]}{c % 8}" for c in wanted]
    chip, port = ffi.new("ht_regfile *"), ffi.new("ht_port *")
    lib.ht_regfile_reset(chip, table.map)
    lib.ht_port_bind(port, chip, ffi.addressof(table))
    lib.ht_board_start(port)
    lib.ht_port_init(port, [[10000, 300, True, 100.0]])

    def converted(soc0: int) -> list[int]:
        """Channels of the conversions that something triggers."""
        words = [
            lib.ht_regfile_word(chip, soc0 + 2 * n)[0]
            | lib.ht_regfile_word(chip, soc0 + 2 * n + 1)[0] << 16
            for n in range(16)
        ]
        return [word >> 15 & 15 for word in words if word >> 20 & 31]

    a, b = converted(ADC_A_SOC0), converted(ADC_B_SOC0)
    adcs = "ABABABAAB"  # the slow ones come last in each
    for adc, found in (("A", a), ("B", b)):
        expected = [c for c, of in zip(wanted, adcs, strict=True) if of == adc]
        if found != expected:
            raise ValueError(f"{board}: ADC-{adc} converts {found}, not {expected}")
    return [
        f"ADCIN{c}" if c >= 14 else f"ADCIN{adc}{c}" for adc, c in zip(adcs, wanted, strict=True)
    ]


def rows(board: str) -> list[tuple[str, str, str, str, str]]:
    """Signal, pin of the device, function, connector, remark."""
    table = getattr(lib, f"ht_board_{board}")
    fixed = not table.map.trip_select
    found = []
    for leg, name in enumerate(LEGS):
        for side, switch in enumerate(("upper", "lower")):
            pin = f"GPIO{table.pwm[2 * leg + side].gpio}"
            found.append((f"{name} {switch}", pin, f"EPWM{table.module[leg] + 1}{'AB'[side]}"))
    found.append(("trip", f"GPIO{table.trip.gpio}", "TZ1" if fixed else "input 1 → TZ1"))
    found.append(("encoder A", f"GPIO{table.encoder_a.gpio}", f"EQEP{table.eqep + 1}A"))
    found.append(("encoder B", f"GPIO{table.encoder_b.gpio}", f"EQEP{table.eqep + 1}B"))
    found.append(("encoder index", f"GPIO{table.encoder_index.gpio}", f"EQEP{table.eqep + 1}I"))
    found.append(("serial receive", f"GPIO{table.receive.gpio}", "SCIRXDA"))
    found.append(("serial transmit", f"GPIO{table.transmit.gpio}", "SCITXDA"))
    for signal, pin in zip(("precharge relay", "brake", "fan", "chopper"), table.output):
        found.append((signal, f"GPIO{pin.gpio}", "GPIO"))
    for k, (signal, pin) in enumerate(zip(ANALOGUE, channels(board), strict=True)):
        number = k < len(table.channel) and lib.ht_board_cmpss(ffi.addressof(table), k)
        found.append((signal, pin, f"ADC, CMPSS{number}" if number else "ADC"))
    remarks = REMARKS.get(board, {})
    return [
        (signal, pin, what, connector(board, pin), remarks.get(pin, ""))
        for signal, pin, what in found
    ]


def heads(board: str) -> list[str]:
    _, title = CONNECTORS.get(board, ({}, "connector"))
    return ["signal", "pin of the device", "function", title, "remark"]


def text(board: str) -> str:
    """What the page has of a board."""
    baud = getattr(lib, f"ht_board_{board}").baud
    return (
        f"[Pins of `{board}`](data/pins-{board}.csv). Serial line: {baud} baud, 8 bits, no parity, "
        "1 stop bit."
    )


def marks(board: str) -> tuple[str, str]:
    return f"<!-- {board}: written by tools/board_tables.py -->", f"<!-- end of {board} -->"


def written(page: str, board: str) -> str:
    """The page's present text between a board's marks."""
    first, last = map(re.escape, marks(board))
    found = re.search(f"{first}\n(.*?){last}", page, re.S)
    if not found:
        raise ValueError(f"{PAGE.name}: no table of {board}")
    return found[1].rstrip("\n")


def main() -> None:
    page = PAGE.read_text()
    for board in BOARDS:
        first, last = marks(board)
        before, rest = page.split(first)
        doc_page.keep_data(PAGE, f"pins-{board}", heads(board), rows(board))
        page = f"{before}{first}\n{text(board)}\n{last}{rest.split(last)[1]}"
    PAGE.write_text(page)


if __name__ == "__main__":
    main()
