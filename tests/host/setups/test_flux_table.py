"""A set-up that names a table of flux linkages: where the file is looked for, what is refused, and
what the drive knows of it."""

import os
import shutil
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from example_setups import EXAMPLES
from flux_tables import HEADER, Iron, text, written

from hexatorque import setups
from hexatorque.setups import SetupError, flux_table
from hexatorque.sweeps.files import read

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


@pytest.mark.parametrize("form", ["flux_map = {}", "flux_map = {{ value = {}, tag = 'measured' }}"])
def test_a_tuned_copy_finds_the_table_that_the_first_one_named(form, tmp_path, monkeypatch):
    edit = pytest.importorskip("hexatorque.tuning.edit")
    written(tmp_path / "map.csv", Iron().rows(50.0, 17))
    source = f"setup = 'magnet-interior'\n[machine]\n{form.format(repr('map.csv'))}\n"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "tuned.toml").write_text(edit.moved(source, Path(".")))
    monkeypatch.chdir("/")
    tuned = setups.load(tmp_path / "out" / "tuned.toml")
    assert tuned["machine.flux_map"] == str(tmp_path / "map.csv")


def test_a_tuned_copy_that_changes_nothing_finds_it_too(tmp_path):
    report = pytest.importorskip("hexatorque.tuning.report")
    written(tmp_path / "map.csv", Iron().rows(50.0, 17))
    file = tmp_path / "mine.toml"
    file.write_text("setup = 'magnet-interior'\n[machine]\nflux_map = 'map.csv'\n")
    tuned = SimpleNamespace(
        request=SimpleNamespace(setup=SimpleNamespace(values={})), best=SimpleNamespace(chosen={})
    )
    (tmp_path / "out").mkdir()
    (tmp_path / "out" / "tuned.toml").write_text(report.setup_text(tuned, str(file)))
    found = setups.load(tmp_path / "out" / "tuned.toml")["machine.flux_map"]
    assert found == str(tmp_path / "map.csv")


def test_a_study_finds_its_tables_beside_it(tmp_path, monkeypatch):
    tables = [written(tmp_path / f"{n}.csv", Iron(bend_q=n / 10).rows(50.0, 17)) for n in (3, 5)]
    (tmp_path / "study.toml").write_text(
        "setup = 'magnet-interior'\n[vary.machine]\nflux_map = ['3.csv', '5.csv', '']\n"
    )
    monkeypatch.chdir("/")
    study = read(tmp_path / "study.toml")
    found = [study.space.design.point(k)["machine.flux_map"] for k in range(3)]
    assert found == [*tables, ""]


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
        (
            Iron(),
            30.0,
            r"id_A is -30 \.\. 30: allowed is -40\.8 \.\. 0 A and more; 40\.8 A is .*i_ab_trip_A",
        ),
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


@pytest.mark.parametrize(
    "most_d_A, most_q_A, said", [(0, 50, None), (0, 40, "iq_A"), (50, 40, "iq_A")]
)
def test_a_table_needs_no_positive_id_but_all_of_iq(tmp_path, most_d_A, most_q_A, said):
    rows = [row for row in Iron().rows(50.0, 21) if row[0] <= most_d_A and row[1] <= most_q_A]
    change = {"machine.flux_map": written(tmp_path / "map.csv", rows)}
    if said is None:
        assert setups.load("magnet-interior").changed(change)["machine.flux_map"]
        return
    with pytest.raises(SetupError, match=rf"{said} is -40 \.\. 40: allowed is -40\.8 \.\. 40\.8 A"):
        setups.load("magnet-interior").changed(change)


def grown(change, **of):
    """Rows of a table, each put through `change`."""
    return [change(*row) for row in Iron(**of).rows(40.0, 17)]


ROWS = list(Iron().rows(40.0, 17))
WRONG = {
    "its first row must be id_A,iq_A,psi_d_Wb,psi_q_Wb, not 'id_A,iq_A,psi_d_mWb,": (
        text(ROWS).replace("psi_d_Wb", "psi_d_mWb")
    ),
    "line 4: four finite numbers": text([*ROWS[:2], ROWS[2][:3], *ROWS[3:]]),
    "line 8: four finite numbers are needed, not '-40.0,10.0,x,y'": "# two lines\n\n"
    + text(ROWS).replace(text(ROWS).split("\n")[5], "-40.0,10.0,x,y"),
    r"line 5: four finite numbers are needed, not '-40\.0,15\.0,nan,0\.2": text(
        [*ROWS[:3], (*ROWS[3][:2], np.nan, 0.2), *ROWS[4:]]
    ),
    "line 4: id_A = -40, iq_A = 5 is there twice": text([*ROWS[:2], ROWS[1], *ROWS[2:]]),
    "the row id_A = -40, iq_A = 10 is missing": text([*ROWS[:2], *ROWS[3:]]),
    "id_A and iq_A must ascend": text(reversed(ROWS)),
    "iq_A has 4 values: allowed are 5": text([row for row in ROWS if row[1] < 20]),
    "id_A must have the value 0": text([row for row in ROWS if row[0] != 0]),
    r"psi_d_Wb at no current = -0.0254: allowed is more than 0": text(
        grown(lambda a, b, d, q: (a, b, d - 0.2, q))
    ),
    "psi_q_Wb at no current = 0.01": text(grown(lambda a, b, d, q: (a, b, d, q + 0.01))),
    "psi_d_Wb along id_A must grow: it does not after id_A = 5,": text(
        grown(lambda a, b, d, q: (a, b, d - (0.05 if a > 5 else 0), q))
    ),
    "psi_q_Wb along iq_A must grow: it does not after id_A = -20, iq_A = -5": text(
        grown(lambda a, b, d, q: (a, b, d, -q))
    ),
    r"L_d at no current = 0\.0174\d* H: allowed is up to 1\.05 L_q, which is 0\.0067\d* H": text(
        Iron(ld=17.4e-3, lq=6.4e-3).rows(10.0, 17)
    ),
    r"differ by 0\.00\d+ H: allowed is 0\.0003": text(
        grown(lambda a, b, d, q: (a, b, d, q * (1 - 0.002 * a)))
    ),
    "an incremental inductance is not above 0 at psi_d": text(
        grown(lambda a, b, d, q: (a, b, d + (0.02 if a > 0 else 0), q))
    ),
}  # fmt: skip


@pytest.mark.parametrize("said", WRONG)
def test_a_wrong_table_is_refused_in_a_line(said, tmp_path):
    (tmp_path / "map.csv").write_text(WRONG[said])
    with pytest.raises(SetupError, match=said) as error:
        flux_table.of(str(tmp_path / "map.csv"))
    assert str(error.value).startswith(f"machine.flux_map = {str(tmp_path / 'map.csv')!r}: ")
    assert "\n" not in str(error.value)


def test_two_currents_of_the_same_fluxes_are_refused(tmp_path):
    """Both axes alone grow, but along a diagonal the coupling makes the fluxes fall again."""
    currents = np.linspace(-40, 40, 17)
    rows = [
        (a, b, 0.2 + 1e-3 * (a + 0.9 * b) + 4e-6 * a * b, 1e-3 * (b + 0.9 * a) + 2e-6 * a * a)
        for a in currents for b in currents
    ]  # fmt: skip
    with pytest.raises(
        SetupError, match=r"comes nearer to it than \S+ Wb: allowed is 0\.002 Wb, 1% of psi_f"
    ):
        flux_table.of(written(tmp_path / "map.csv", rows))


def test_comments_and_a_table_of_both_halves():
    half = flux_table.table(f"# by hand\n\n{text(Iron().rows(40.0, 9))}")
    rows = [(a, b, *Iron().flux_Wb(a, b)) for a in half[0] for b in half[1]]
    whole = flux_table.table("\n".join([HEADER, *(",".join(map(str, row)) for row in rows)]))
    for a, b in zip(half, whole):
        np.testing.assert_allclose(a, b, atol=1e-12)


def test_a_changed_file_is_read_again(tmp_path):
    path = tmp_path / "map.csv"
    first = flux_table.of(written(path, Iron().rows(40.0, 9)))
    written(path, Iron(psi_f=0.19).rows(40.0, 9))
    os.utime(path, ns=(1, 1))
    assert flux_table.of(str(path)).psi_f_Wb == pytest.approx(0.19) != first.psi_f_Wb
