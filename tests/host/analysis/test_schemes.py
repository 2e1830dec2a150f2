"""What the user is told of the schemes follows from the firmware's tables."""

import math

from hexatorque import firmware
from hexatorque.analysis.schemes import OPTIONS, SCHEMES


def test_every_scheme_has_its_row():
    assert tuple(SCHEMES) == firmware.schemes()
    for row in SCHEMES.values():
        assert all(len(row[key]) > 5 for key in ("source", "vectors", "xy", "reach"))


def test_levels_limits_and_reach_are_the_firmwares():
    assert [SCHEMES[name]["torque_levels"] for name in ("dtc1", "dtc3", "foc")] == ["3", "5", "-"]
    for name, row in SCHEMES.items():
        assert (", limit 0." in row["xy"]) == (name in ("ddr", "ddr-ml"))
    # Duty ratios d, 1 - 2 d, d of three large vectors make no x-y voltage: (1 - 2 d) = 2 d cos 30.
    # The locus of their mean voltages has twelve corners; a circle in it is shorter by cos 15.
    d = 1 / (2 + 2 * math.cos(math.pi / 6))
    corner = (math.sqrt(6) + math.sqrt(2)) / 6 * (1 - 2 * d + 2 * d * math.cos(math.pi / 6))
    assert SCHEMES["ddr"]["reach"] == f"{corner * math.cos(math.pi / 12):.4f} Vdc"


def test_an_options_choices_are_those_of_its_parameter():
    assert OPTIONS["controller.table"]["choices"] == "45/135 | 75/105"
    assert OPTIONS["controller.torque_levels"]["choices"] == "auto | 2 | 3 | 5"
    assert OPTIONS["controller.torque_release_Nm"]["choices"] == "number"
    assert OPTIONS["controller.zero_hold"]["help"] == firmware.parameters()["zero_hold"].help
