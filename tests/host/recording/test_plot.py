"""A recording's picture and table: true values and the firmware's are told apart by name."""

import numpy as np
import pytest

from hexatorque.errors import InputError
from hexatorque.recording.recording import Recording

TRUE_NM, ESTIMATE_NM = np.linspace(0, 1, 50), np.linspace(0, 2, 50)


@pytest.fixture
def recording():
    channels = {
        "torque_Nm": ESTIMATE_NM,
        "torque_level": np.zeros(50),
        "plant.torque_Nm": TRUE_NM,
        "i_u1_A": np.ones(50),
    }
    units = {"torque_Nm": "N m", "torque_level": "", "plant.torque_Nm": "N m", "i_u1_A": "A"}
    return Recording(1e3, channels, units, {"scheme": "ddr"}, 0.5)


def lines(figure):
    """What each panel shows: title, unit, name -> values."""
    return [
        (
            ax.get_title(loc="left"),
            ax.get_ylabel(),
            {line.get_label(): line.get_ydata().tolist() for line in ax.lines},
        )
        for ax in figure.axes
    ]


def test_true_and_estimated_values_have_names_of_their_own(recording):
    assert recording["plant.torque_Nm"] is TRUE_NM
    assert recording["firmware.torque_Nm"] is recording["torque_Nm"] is ESTIMATE_NM
    assert "firmware.torque_Nm" in recording and "firmware.plant.torque_Nm" in recording
    assert "firmware.torqe_Nm" not in recording and 3 not in recording
    assert list(recording.channels) == ["torque_Nm", "torque_level", "plant.torque_Nm", "i_u1_A"]


def test_a_quantity_is_drawn_with_both_its_values(recording, tmp_path):
    figure = recording.plot("torque", file=tmp_path / "new" / "torque.png")
    both = {
        "plant.torque_Nm (true)": TRUE_NM.tolist(),
        "torque_Nm (firmware)": ESTIMATE_NM.tolist(),
    }
    assert lines(figure) == [("torque", "N m", both)]
    assert (tmp_path / "new" / "torque.png").read_bytes().startswith(b"\x89PNG")
    assert figure.axes[0].lines[0].get_xdata().tolist() == recording.time_s.tolist()


def test_a_channel_is_drawn_alone(recording, tmp_path):
    file = tmp_path / "a.png"
    for name in ("torque_Nm", "firmware.torque_Nm"):
        estimate = {"torque_Nm (firmware)": ESTIMATE_NM.tolist()}
        assert lines(recording.plot(name, file=file)) == [(name, "N m", estimate)]
    panels = lines(recording.plot("plant.torque_Nm", "torque_level", file=file))
    assert [title for title, _, _ in panels] == ["plant.torque_Nm", "torque_level"]


def test_without_a_name_the_main_quantities_are_drawn(recording, tmp_path):
    panels = lines(recording.plot(file=tmp_path / "a.png"))
    assert [title for title, _, _ in panels] == ["i_u1", "torque"]
    other = Recording(1e3, {"x": np.zeros(3)})
    assert [title for title, _, _ in lines(other.plot(file=tmp_path / "a.png"))] == ["x"]


def test_without_a_file_the_figure_is_pyplot_s(recording):
    from matplotlib import pyplot

    pyplot.switch_backend("agg")
    figure = recording.plot("torque")
    assert pyplot.figure(figure.number) is figure
    pyplot.close(figure)


@pytest.mark.parametrize(
    ("ask", "said"),
    [
        (lambda r: r["torqe_Nm"], "no channel 'torqe_Nm'; did you mean 'torque_Nm'?"),
        (lambda r: r[3], "no channel 3; known: torque_Nm, torque_level"),
        (lambda r: r.plot("torqe"), "no channel 'torqe'; did you mean 'torque'?"),
        (lambda r: r.plot(3), "no channel 3; known: torque_Nm"),
        (lambda r: r.plot("torque", file="a.jpg"), "a.jpg: a picture is a .png"),
        (lambda r: r.to_pandas("speed_rpm"), "no channel 'speed_rpm'; known: torque_Nm"),
        (lambda r: Recording(1e3, {}).plot(), "the recording has no channels"),
    ],
)
def test_a_mistake_is_one_line(recording, ask, said):
    with pytest.raises(InputError) as caught:
        ask(recording)
    assert str(caught.value).startswith(said) and "\n" not in str(caught.value)


def test_a_picture_that_cannot_be_written(recording, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match=r"a\.png: (Not a directory|File exists)"):
        recording.plot("torque", file=tmp_path / "file" / "a.png")


def test_a_table_has_the_units(recording):
    pandas = pytest.importorskip("pandas")
    frame = recording.to_pandas()
    assert isinstance(frame, pandas.DataFrame) and list(frame.columns) == list(recording.channels)
    assert frame.index.name == "time_s" and frame.index.tolist() == recording.time_s.tolist()
    assert frame.attrs == {"units": recording.units, "meta": {"scheme": "ddr"}}
    named = recording.to_pandas("firmware.torque_Nm", "plant.torque_Nm")
    assert named["firmware.torque_Nm"].tolist() == ESTIMATE_NM.tolist()
    assert named.attrs["units"] == {"firmware.torque_Nm": "N m", "plant.torque_Nm": "N m"}


def test_without_pandas_the_table_says_what_to_install(recording, monkeypatch):
    import sys

    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"pip install 'hexatorque\[sweep\]'"):
        recording.to_pandas()
