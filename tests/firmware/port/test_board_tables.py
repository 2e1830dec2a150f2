"""docs/first-spin.md says of every board what the firmware has, and its front end and its
limits are the firmware's. `python tools/board_tables.py` writes the tables.
"""

import math
import re

import board_tables
import doc_page
import pytest
from board_tables import DIMM100, LAUNCHPAD, PAGE

from hexatorque.firmware import BOARDS, ffi, lib

TEXT = PAGE.read_text()


@pytest.mark.parametrize("board", BOARDS)
def test_tables_are_the_boards(board):
    written, wanted = board_tables.written(TEXT, board), board_tables.text(board)
    assert written == wanted, f"python tools/board_tables.py; wanted:\n{wanted}"
    rows = [board_tables.heads(board), *map(list, board_tables.rows(board))]
    assert doc_page.read_data(PAGE, f"pins-{board}") == rows, "python tools/board_tables.py"


@pytest.mark.parametrize("board", BOARDS)
def test_a_table_in_words(board):
    """Read from the data, not from the tool: every signal once, no pin twice, upper and lower
    switch of a leg on A and B of one module, the numbers those of `ht_board.c`."""
    table = getattr(lib, f"ht_board_{board}")
    rows = doc_page.read_data(PAGE, f"pins-{board}")[1:]
    signals = {row[0]: row[1:] for row in rows}
    assert len(signals) == len(rows) == 12 + 6 + 4 + 7 + 2
    pins = [row[1] for row in rows]
    assert len(set(pins)) == len(pins)
    for leg, name in enumerate(("u1", "u2", "w1", "w2", "v1", "v2")):
        upper, lower = signals[f"{name} upper"], signals[f"{name} lower"]
        assert [upper[0], lower[0]] == [f"GPIO{table.pwm[2 * leg + k].gpio}" for k in (0, 1)]
        module = table.module[leg] + 1
        assert [upper[1], lower[1]] == [f"EPWM{module}A", f"EPWM{module}B"]
        number = table.channel[leg]
        assert re.fullmatch(r"ADCIN[ABCD]?\d+", signals[f"current {name}"][0])
        digits = re.findall(r"\d+", signals[f"current {name}"][0])
        assert digits == [str(number % 8 if table.map.adc_sequencer else number)]
    for signal, pin in (
        ("trip", table.trip), ("encoder A", table.encoder_a), ("encoder B", table.encoder_b),
        ("encoder index", table.encoder_index),
        ("serial receive", table.receive), ("serial transmit", table.transmit),
        ("precharge relay", table.output[0]), ("brake", table.output[1]), ("fan", table.output[2]),
        ("chopper", table.output[3]),
    ):  # fmt: skip
        assert signals[signal][0] == f"GPIO{pin.gpio}"
    assert f"Serial line: {table.baud} baud" in board_tables.written(TEXT, board)


def test_each_connector_pin_is_used_once():
    for pins in (LAUNCHPAD, DIMM100):
        assert len(set(pins.values())) == len(pins)
    assert all(1 <= n <= 80 for n in LAUNCHPAD) and all(1 <= n <= 100 for n in DIMM100)
    # GPIO0, 1 and 5..9 have no pin in the LaunchPad's package (data sheet).
    assert not {f"GPIO{n}" for n in (0, 1, 5, 6, 7, 8, 9)} & set(LAUNCHPAD.values())
    for board, pins in (("launchxl_f28377s", LAUNCHPAD), ("f28335", DIMM100)):
        for signal, pin, *_ in board_tables.rows(board):
            if not signal.startswith("serial") or board == "f28335":
                assert pin in pins.values(), f"{board}: {signal} is on no connector"


# --- the worked front end -----------------------------------------------------------------


def value(quantity, table):
    """The second cell of a row of a table beside the page, as its numbers."""
    rows = {row[0]: row[1] for row in doc_page.read_data(PAGE, table)}
    cell = rows[quantity.replace("`", "")]
    return [float(x.replace("−", "-")) for x in re.findall(r"[−-]?\d+\.?\d*", cell)]


CURRENT, LINK = "front-end-current", "front-end-dc-link"
V_REF = 3.0


def near(found, want, share=0.005):
    assert found == pytest.approx(want, rel=share)


def test_front_end_of_a_current():
    """From the components on the page: 2.00 and 3.00 kohm, 2.2 nF, 100 ohm, 22 nF, 75 mV/A
    around 2.5 V; the ADC's 14.5 pF behind 425 ohm (12 bits, single-ended) and 50 kohm to ground."""
    divider = 3.00 / 5.00
    slope = 0.075 * divider
    full = (V_REF / 2) / slope
    near(value("divider", CURRENT), [divider])
    near(value("at zero current", CURRENT), [2.5 * divider])
    assert 2.5 * divider == pytest.approx(V_REF / 2)
    near(value("slope at the ADC", CURRENT), [1000 * slope])
    near(value("`i_full_A`", CURRENT), [full])
    near(value("resolution", CURRENT), [1000 * 2 * full / 4096])
    near(value("highest `i_trip_A` that is accepted", CURRENT), [0.885 * full])
    near(value("what the sensor allows", CURRENT), [80 / 3])
    near(
        value("comparators for the trip pin, ± 26 A", CURRENT), [1.5 + 26 * slope, 1.5 - 26 * slope]
    )
    source, first, second = 2.0e3 * 3.0e3 / 5.0e3, 2.2e-9, 22e-9
    taus = (source * first, 100 * second)
    near(
        value("filter before the buffer", CURRENT),
        [1e-3 / (2 * math.pi * taus[0]), 1e6 * taus[0]],
    )
    near(value("filter at the ADC", CURRENT), [1e-3 / (2 * math.pi * taus[1]), 1e6 * taus[1]])
    delay, degrees, hertz = value("delay of both", CURRENT)
    near(delay, 1e6 * sum(taus))
    near(degrees, 360 * hertz * sum(taus), 0.03)
    near(value("kick of the sampling capacitor", CURRENT), [4096 * 14.5e-12 / second], 0.02)
    left = 4096 * math.exp(-100e-9 / (425 * 14.5e-12))
    assert value("what is left after the sampling window", CURRENT)[0] == pytest.approx(
        left, abs=0.05
    )
    assert value("pull-down of 50 kΩ in the chip", CURRENT) == pytest.approx(
        [-100 * 100 / 50.1e3], abs=0.01
    )
    assert "`i_trip_A` of 25 A at most" in TEXT and 25 < 80 / 3 and 25 < 0.885 * full


def test_front_end_of_the_dc_link():
    divider = 6.04 / (4 * 249 + 6.04)
    full = V_REF / divider
    near(value("divider", LINK), [divider])
    near(value("`vdc_full_V`", LINK), [full], 0.0005)
    near(value("resolution", LINK), [full / 4096])
    near(value("highest `vdc_max_V` that is accepted", LINK), [0.95 * full])
    source = 996e3 * 6.04e3 / 1002.04e3
    near(value("filter", LINK), [1e-3 / (2 * math.pi * source * 2.2e-9), 1e6 * source * 2.2e-9])
    each = 500 * 249 / 1002.04
    near(value("each resistor at 500 V", LINK), [each, 1000 * each**2 / 249e3])


def test_the_firmware_takes_these_scales_and_no_higher_limits():
    """The page's `i_full_A` and `vdc_full_V` go into a drive; a trip level just below the
    page's highest is taken, just above it is not; a count is what the page says it is."""
    from hexatorque import setups
    from hexatorque.drive.simulated import SimulatedDrive
    from hexatorque.firmware import FirmwareError

    sim = SimulatedDrive(setups.load("paper-a-feasible"))
    (i_full,), (v_full,) = value("`i_full_A`", CURRENT), value("`vdc_full_V`", LINK)
    sim.set("i_trip_A", 20.0)
    sim.set("i_full_A", i_full)
    sim.set("vdc_full_V", v_full)
    (i_most,) = value("highest `i_trip_A` that is accepted", CURRENT)
    (v_most,) = value("highest `vdc_max_V` that is accepted", LINK)
    for name, most, step in (("i_trip_A", i_most, 0.1), ("vdc_max_V", v_most, 0.5)):
        sim.set(name, most - step)
        with pytest.raises(FirmwareError):
            sim.set(name, most + step)
    drive = sim.controller.drive
    assert 1000 * drive.i_per_count == pytest.approx(value("resolution", CURRENT)[0], rel=0.005)
    assert drive.v_per_count == pytest.approx(value("resolution", LINK)[0], rel=0.005)


def test_default_encoder_and_board_limits():
    """What the page says of defaults and limits."""
    params = {
        ffi.string(lib.ht_param_describe(n).name).decode(): lib.ht_param_describe(n)
        for n in range(lib.ht_param_count())
    }
    assert f"`encoder_counts_rev` = {params['encoder_counts_rev'].initial:.0f}" in TEXT
    assert f"(`dead_time_us`, {params['dead_time_us'].initial:.1f} µs by default)" in TEXT
    state_us = 60e6 / (6000 * params["encoder_counts_rev"].initial)
    assert f"{state_us:.2f} µs" in TEXT


# --- the list -----------------------------------------------------------------------------


def test_every_step_says_what_to_do_what_to_expect_and_when_to_stop():
    parts = re.split(r"^### (\d+)\. ", TEXT[TEXT.index("## Power-up") :], flags=re.M)[1:]
    numbers, bodies = parts[::2], parts[1::2]
    assert [int(n) for n in numbers] == list(range(1, len(numbers) + 1))
    for number, body in zip(numbers, bodies, strict=True):
        labels = re.findall(r"^- \*\*(Do|Expect|Stop if):\*\*", body, re.M)
        assert labels == ["Do", "Expect", "Stop if"], number
