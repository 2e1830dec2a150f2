"""A set-up that names a table of flux linkages: where the file is looked for, what is refused, and
what the drive knows of it."""

import shutil

import pytest
from example_setups import EXAMPLES
from flux_tables import Iron, written

from hexatorque import setups
from hexatorque.setups import SetupError

EXAMPLE = EXAMPLES / "magnet-saturation.toml"


def test_a_file_is_beside_the_set_up_that_names_it(tmp_path, monkeypatch):
    for file in (EXAMPLE, EXAMPLE.with_suffix(".csv")):
        shutil.copy(file, tmp_path)
    monkeypatch.chdir("/")
    loaded = setups.load(tmp_path / EXAMPLE.name)
    assert loaded["machine.flux_map"] == str(tmp_path / "magnet-saturation.csv")
    (tmp_path / "sub").mkdir()
    other = tmp_path / "sub" / "other.toml"
    other.write_text(f'setup = "../{EXAMPLE.name}"\n')
    assert setups.load(other)["machine.psi_f_Wb"] == loaded["machine.psi_f_Wb"]
    other.write_text('setup = "../magnet-saturation.toml"\n[machine]\nflux_map = ""\n')
    assert setups.load(other)["machine.flux_map"] == ""


def test_the_drive_knows_nothing_of_it():
    true = setups.load(EXAMPLE)
    assert setups.parameters(true) == setups.parameters(true.changed(machine__flux_map=""))


def test_another_machines_or_a_short_table_is_refused_in_a_line(tmp_path):
    base = setups.load("magnet-interior")
    for made, most_A, said in (
        (
            Iron(psi_f=0.3),
            50.0,
            r"psi_d_Wb at no current = 0\.3: allowed is 0\.131 \.\. 0\.2182 Wb",
        ),
        (Iron(), 30.0, r"its currents end at 30 A: allowed is 40\.8 A and more, .*i_ab_trip_A"),
    ):
        file = written(tmp_path / "map.csv", made.rows(most_A, 17))
        with pytest.raises(SetupError, match=said) as error:
            base.changed(machine__flux_map=file)
        assert str(error.value).startswith(f"machine.flux_map = {file!r}: ")
        assert "\n" not in str(error.value)
        (tmp_path / "map.csv").unlink()
    for value, said in (("nix.csv", "No such file"), (3, "the name of a file is needed")):
        with pytest.raises(SetupError, match=f"machine.flux_map = {value!r}: {said}"):
            base.changed(machine__flux_map=value)
    with pytest.raises(SetupError, match="the model induction has no such value"):
        setups.load("paper-b").changed(machine__flux_map="nix.csv")
