"""Tables in the layouts of several makers of oscilloscopes, written from the description of each
layout with any numbers, are read back with their names, units, times and samples. What is damaged
is refused, with its line: no row is left out."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hexatorque.given import decode
from hexatorque.recording import table
from hexatorque.recording.csv import _plain
from hexatorque.recording.recording import Recording, RecordingError


def number(value: float, comma: bool = False) -> str:
    return f"{value:.6e}".replace(".", "," if comma else ".")


def joined(rows, delimiter=","):
    return "".join(delimiter.join(row) + "\n" for row in rows)


def of_samples(times, columns, comma=False):
    return [[number(v, comma) for v in row] for row in zip(times, *columns)]


def tektronix(times, columns, step):
    """MDO, MSO: keywords and values, then the names; the units are in the header only."""
    n = len(columns)
    head = [
        ["Model", "MDO3024"], ["Firmware Version", "1.22"], [""], ["Point Format", "Y", ""],
        ["Horizontal Units", "S", ""], ["Horizontal Scale", "0.004", ""],
        ["Sample Interval", number(step), ""], ["Record Length", str(len(times)), ""],
        ["Probe Attenuation", *["10"] * n], ["Vertical Units", *["V"] * n],
        ["Vertical Offset", *["0"] * n], ["Vertical Scale", *["1"] * n], ["Label", *[""] * n],
        ["TIME", *(f"CH{k + 1}" for k in range(n))],
    ]  # fmt: skip
    return joined(head + of_samples(times, columns))


def tektronix_beside(times, columns, step):
    """TDS: the header in columns 1 to 3, beside the samples of one channel in columns 4 and 5."""
    head = [
        ["Record Length", "2.500000e+03"], ["Sample Interval", number(step)],
        ["Trigger Point", "1.25e+03"], ["", ""], ["", ""], ["", ""], ["Source", "CH1"],
        ["Vertical Units", "V"], ["Vertical Scale", "5.0e-01"], ["Vertical Offset", "0.0"],
        ["Horizontal Units", "s"], ["Horizontal Scale", "5.0e-03"], ["Pt Fmt", "Y"],
        ["Yzero", "0.0"], ["Probe Atten", "1.0e+00"], ["Model Number", "TDS2024"],
    ]  # fmt: skip
    rows = of_samples(times, columns[:1])
    head += [["", ""]] * (len(rows) - len(head))
    return joined([*left, "", *row, ""] for left, row in zip(head, rows))


def keysight(times, columns, step):
    """Two lines: names that are numbers, and units as words."""
    n = len(columns)
    head = [["x-axis", *(str(k + 1) for k in range(n))], ["second", *["Volt"] * n]]
    return joined(head + of_samples(times, columns))


def infiniium(times, columns, step):
    """A keyword in each line and the samples of one channel. `Start` is the number of a sample."""
    head = [
        ["Revision:0"], ["Type:raw"], ["Start:0"], [f"Points:{len(times)}"], [f"XInc:{step:+.6e}"],
        [f"XOrg:{times[0]:+.6e}"], ["XUnits:Second"], ["YUnits:Volt"], ["Data:"],
    ]  # fmt: skip
    return joined(head + [[number(value)] for value in columns[0]])


def infiniium_with_times(times, columns, step):
    """The same with commas and a column of time."""
    head = [
        ["Type:", "raw"], ["Start:", "0"], ["XInc:", number(step)], ["XOrg:", number(times[0])],
        ["X Units:", "second"], ["Y Units:", "Volt"], ["Data:", ""],
    ]  # fmt: skip
    return joined(head + of_samples(times, columns[:1]))


def rigol(times, columns, step):
    """The samples are counted; start and increment stand in the header, without a column."""
    n = len(columns)
    head = [
        ["X", *(f"CH{k + 1}" for k in range(n)), "Start", "Increment"],
        ["Sequence", *["Volt"] * n, number(times[0]), number(step)],
    ]
    rows = [[str(k), *map(number, row), "", ""] for k, row in enumerate(zip(*columns))]
    return joined(head + rows)


def siglent(times, columns, step):
    n = len(columns)
    names = [f"CH{k + 1}" for k in range(n)]
    head = [
        ["Record Length", f"Analog:{len(times)}"], ["Sample Interval", f"Analog:{number(step)}"],
        ["Vertical Units", *(f"{c}:V" for c in names)],
        ["Vertical Scale", *(f"{c}:1.00" for c in names)], ["Horizontal Units", "S"],
        ["Model Number", "SDS2354X"], ["Software Version", "1.3.9"], ["Source", *names],
        ["Second", *["Volt"] * n],
    ]  # fmt: skip
    return joined(head + of_samples(times, columns))


def picoscope(times, columns, step):
    n = len(columns)
    head = [["Time", *(f"Channel {chr(65 + k)}" for k in range(n))], ["(ms)", *["(mV)"] * n], [""]]
    rows = of_samples(times * 1e3, [c * 1e3 for c in columns])
    return joined(head + rows)


def picoscope_of_germany(times, columns, step):
    n = len(columns)
    head = [["Zeit", *(f"Kanal {chr(65 + k)}" for k in range(n))], ["(ms)", *["(mV)"] * n], [""]]
    rows = of_samples(times * 1e3, [c * 1e3 for c in columns], comma=True)
    return joined(head + rows, ";")


def lecroy(times, columns, step):
    """A header block of tables of its own; no units."""
    head = [
        ["LECROYWS424", "17291", "Waveform"], ["Segments", "1", "SegmentSize", str(len(times))],
        ["Segment", "TrigTime", "TimeSinceSegment1"], ["#1", "03-Nov-2015 17:26:18", "0"],
        ["Time", "Ampl"],
    ]  # fmt: skip
    return joined(head + of_samples(times, columns[:1]))


def rohde_schwarz(times, columns, step):
    head = [["in s", *(f"CH{k + 1} in V" for k in range(len(columns)))]]
    return joined(head + of_samples(times, columns))


def tabs(times, columns, step):
    head = [["t [us]", *(f"u{k} [kV]" for k in range(len(columns)))]]
    rows = of_samples(times * 1e6, [c * 1e-3 for c in columns], comma=True)
    return joined(head + rows, "\t")


def plecs(times, columns, step):
    """Units behind a slash, names in quotes."""
    head = [['"Time / s"', *(f'"Scope {k} / V"' for k in range(len(columns)))]]
    return joined(head + of_samples(times, columns))


def ltspice(times, columns, step):
    """Nodes in parentheses, which are no units."""
    head = [["time", *(f"V(n{k})" for k in range(len(columns)))]]
    return joined(head + of_samples(times, columns), "\t")


#: The layout, and the names that it gives its channels.
LAYOUTS = {
    tektronix: ("CH1", "CH2", "CH3"),
    tektronix_beside: ("CH1",),
    keysight: ("1", "2", "3"),
    infiniium: ("column 1",),
    infiniium_with_times: ("column 2",),
    rigol: ("CH1", "CH2", "CH3"),
    siglent: ("CH1", "CH2", "CH3"),
    picoscope: ("Channel A", "Channel B", "Channel C"),
    picoscope_of_germany: ("Kanal A", "Kanal B", "Kanal C"),
    lecroy: ("Ampl",),
    rohde_schwarz: ("CH1", "CH2", "CH3"),
    tabs: ("u0", "u1", "u2"),
    plecs: ("Scope 0", "Scope 1", "Scope 2"),
    ltspice: ("V(n0)", "V(n1)", "V(n2)"),
}
of_layouts = pytest.mark.parametrize("layout", LAYOUTS, ids=lambda layout: layout.__name__)
#: Those with a cell for the time or the number of each sample.
of_layouts_with_times = pytest.mark.parametrize(
    "layout", [x for x in LAYOUTS if x is not infiniium], ids=lambda layout: layout.__name__
)


def read(text: str):
    return _plain(text, "no header")


def written(layout, n=40, channels=2, start_s=-2e-3, step_s=4e-6):
    columns = np.random.default_rng(3).normal(size=(channels, n))
    return layout(start_s + step_s * np.arange(n), columns, step_s)


values = st.floats(-1e6, 1e6, allow_subnormal=False).map(lambda v: float(f"{v:.6e}"))


@of_layouts
@settings(max_examples=40, deadline=None)
@given(data=st.data())
def test_what_is_written_is_read(layout, data):
    # A header beside the samples is shorter than they are.
    n = data.draw(st.integers(20 if layout is tektronix_beside else 2, 40), "samples")
    channels = min(data.draw(st.integers(1, 3), "channels"), len(LAYOUTS[layout]))
    step_s = data.draw(st.sampled_from([1e-9, 2e-7, 4e-6, 1e-4, 0.05]), "step")
    start = data.draw(st.integers(-20, 20), "start in steps")
    columns = np.array(
        [data.draw(st.lists(values, min_size=n, max_size=n)) for _ in range(channels)]
    )
    times = step_s * (start + np.arange(n))
    rec = read(layout(times, columns, step_s))
    assert tuple(rec.channels) == LAYOUTS[layout][:channels]
    assert rec.rate_Hz == pytest.approx(1 / step_s, rel=1e-6)
    assert rec.start_s == pytest.approx(times[0], abs=1e-6 * step_s * 50)
    for name, column in zip(rec.channels, columns):
        np.testing.assert_allclose(rec[name], column, rtol=2e-6, atol=1e-12)
    if layout is not lecroy:
        assert set(rec.units.values()) == {"V"}


@of_layouts
@pytest.mark.parametrize("encoded", ["utf-8", "utf-8-sig", "utf-16", "utf-16-le", "cp1252"])
def test_any_encoding_and_line_end(layout, encoded):
    text = written(layout)
    raw = text.replace("\n", "\r\n").replace("[us]", "[µs]").encode(encoded)
    found, wanted = read(decode(raw)), read(text)
    assert (found.rate_Hz, found.start_s) == (wanted.rate_Hz, wanted.start_s)
    for name in wanted.channels:
        np.testing.assert_array_equal(found[name], wanted[name])


@of_layouts
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_a_damaged_cell_is_named_with_its_line_and_no_row_is_left_out(layout, data):
    """Any cell of any row: of its time, too, and in the first rows beside a header."""
    text = written(layout)
    lines = text.splitlines()
    delimiter = table.find(text).delimiter
    rows = [n for n, line in enumerate(lines) if n >= len(lines) - 40]
    at = data.draw(st.sampled_from(rows), "line")
    cells = lines[at].split(delimiter)
    columns = [
        n for n, cell in enumerate(cells) if cell and (layout is not tektronix_beside or n > 2)
    ]
    column = data.draw(st.sampled_from(columns), "column")
    cells[column] = data.draw(st.sampled_from(["x", "1.2.3", "--", "1_0", "1.2 V", "∞", "1e999"]))
    lines[at] = delimiter.join(cells)
    with pytest.raises(RecordingError, match=rf"^line {at + 1}\b"):
        read("\n".join(lines))


@of_layouts
def test_a_first_row_without_any_number_is_no_line_of_names(layout):
    lines = written(layout).splitlines()
    delimiter = table.find("\n".join(lines)).delimiter
    at = len(lines) - 40
    cells = lines[at].split(delimiter)
    left = 3 if layout is tektronix_beside else 0
    lines[at] = delimiter.join([*cells[:left], *(f"x{n}" for n in range(len(cells) - left))])
    with pytest.raises(RecordingError):
        read("\n".join(lines))
    if layout is tektronix_beside:
        lines[at] = delimiter.join([*cells[:left], *[""] * (len(cells) - left)])
        with pytest.raises(RecordingError, match=r"^line 1: no time"):
            read("\n".join(lines))


@of_layouts_with_times
def test_a_row_that_is_cut_short_or_too_long_is_refused(layout):
    lines = written(layout).splitlines()
    delimiter = table.find("\n".join(lines)).delimiter
    for at in (len(lines) - 20, len(lines) - 1):
        row = lines[at].rstrip(delimiter).split(delimiter)
        short = [*lines[:at], delimiter.join(row[:-1]), *lines[at + 1 :]]
        long = [*lines[:at], lines[at] + delimiter + "7", *lines[at + 1 :]]
        for wrong in (short, long):
            with pytest.raises(RecordingError, match=rf"line {at + 1}[:,]"):
                read("\n".join(wrong))


@of_layouts_with_times
def test_a_time_that_does_not_rise_is_refused(layout):
    lines = written(layout).splitlines()
    lines[-5], lines[-4] = lines[-4], lines[-5]
    with pytest.raises(RecordingError, match=r"^line \d+: time goes from"):
        read("\n".join(lines))


@pytest.mark.parametrize(
    ("layout", "name"),
    [(tektronix, "TIME"), (picoscope, "Time"), (lecroy, "\nTime"), (keysight, "second"),
     (siglent, "Second"), (rohde_schwarz, "in s"), (rigol, "Increment"), (rigol, "Start")],
)  # fmt: skip
def test_without_the_name_or_unit_of_the_time_nothing_is_taken_for_it(layout, name):
    """It never begins at 0 with a step that nobody told."""
    text = written(layout).replace(name, "\nTixe" if name[0] == "\n" else "Tixe", 1)
    if layout is siglent:
        text = text.replace("Horizontal Units,S", "")
    if layout is picoscope:  # the line of units still tells its unit
        assert read(text).start_s == pytest.approx(-2e-3)
        text = text.replace("(ms)", "(mx)")
    with pytest.raises(RecordingError, match=r"no column of time: .*start and increment"):
        read(text)


def test_the_case_of_a_prefix_matters():
    head = "Time,a\n({}),(mV)\n\n0,1\n1,2\n"
    assert read(head.format("ms")).rate_Hz == 1000
    assert list(read(head.format("ms"))["a"]) == [1e-3, 2e-3]
    assert list(read(head.format("ms").replace("mV", "MV"))["a"]) == [1e6, 2e6]
    for wrong in ("MS", "Ms", "mS", "H", "V"):
        with pytest.raises(RecordingError, match=f"time in '{wrong}', known are s, ms"):
            read(head.format(wrong))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 4999), st.booleans())
def test_a_thousands_point_between_decimal_commas_is_found_in_any_row(at, quoted):
    """It is a silent factor of 1000 otherwise."""
    lines = [f"{k};{k},5" for k in range(5000)]
    lines[at] = f"{at};{'1.234'}"
    if quoted:
        lines = [f'"{line.replace(";", chr(34) + ";" + chr(34))}"' for line in lines]
    with pytest.raises(
        RecordingError, match=r"line \d+, a: .* only a decimal (comma|point)"
    ) as said:
        read("t;a\n" + "\n".join(lines))
    assert "1.234" in str(said.value)


def test_a_name_with_a_comma_is_no_decimal_comma():
    rec = read("t;State;a\n0;on, ok;1.5\n1;off, ok;2.5\n")
    assert list(rec["a"]) == [1.5, 2.5]


def test_the_samples_of_a_counted_table_that_are_missing_are_nan():
    text = "X,CH1,Start,Increment\nSequence,Volt,-1e-3,5e-4\n0,1,,\n1,2,,\n2,2,,\n4,3,,\n"
    rec = read(text)
    assert rec.rate_Hz == 2000 and rec.start_s == -1e-3
    np.testing.assert_array_equal(rec["CH1"], [1, 2, 2, np.nan, 3])
    with pytest.raises(RecordingError, match=r"^line 4, X: whole numbers that count"):
        read(text.replace("\n1,2", "\n1.5,2"))


def test_start_is_the_number_of_a_sample_where_its_value_stands_behind_it():
    text = "Start:,0\nXInc:,1E-03\nXOrg:,-1E-02\nData:,\n1,\n2,\n"
    assert read(text).start_s == -1e-2
    with pytest.raises(RecordingError, match="no column of time"):
        read(text.replace("XOrg", "Org"))


def test_a_blank_line_is_a_lost_sample_where_lines_are_counted():
    lines = written(infiniium).splitlines()
    lines[-20] = ""
    with pytest.raises(RecordingError, match=rf"^line {len(lines) - 19}: blank, but the lines are"):
        read("\n".join(lines))


@pytest.mark.parametrize("unit", ["mVolt", "mV", "millivolt", "Millivolts", "mVolts"])
def test_prefixes_of_words_are_scaled_too(unit):
    rec = read(f"x-axis,1\nsecond,{unit}\n0,1500\n1,2500\n")
    assert rec.units == {"1": "V"} and list(rec["1"]) == [1.5, 2.5]


def test_the_word_value_is_no_unit():
    rec = read("Source,CH1\nSecond,Value\n0,1\n1,2\n")
    assert rec.units == {"CH1": ""} and list(rec["CH1"]) == [1, 2]
    rec = read("Vertical Units,CH1:mA\nSource,CH1\nSecond,Value\n0,1500\n1,2500\n")
    assert rec.units == {"CH1": "A"} and list(rec["CH1"]) == [1.5, 2.5]


def test_a_clipped_sample_is_refused_with_what_to_do():
    with pytest.raises(RecordingError, match=r"^line 5, Channel A: '-∞' is not a number") as said:
        read("Time,Channel A\n(ms),(mV)\n\n0,1\n1,-∞\n2,3\n")
    assert "out of range; choose a larger range at the scope" in str(said.value)


def test_units_for_more_columns_than_names():
    with pytest.raises(RecordingError, match=r"^line 3: 3 cells where there are 1 names$"):
        read("Vertical Units,V,V\nTIME\n0.001,0.1,1\n0.002,0.2,1\n")


def test_a_line_of_units_without_a_time_is_no_line_of_names():
    with pytest.raises(RecordingError, match=r"no column of time: .*there are CH1, CH2$"):
        read("CH1,CH2\nVolt,Volt\n1,2\n2,3\n")


def test_start_and_increment_in_cells_of_their_own():
    rec = read("CH1V,CH2V,t0 =-5.0e-04s, tInc = 1.0e-03,\n1,2,,,\n3,4,,,\n")
    assert (rec.start_s, rec.rate_Hz) == (-5e-4, 1000)
    assert list(rec["CH2V"]) == [2, 4]


def test_a_second_table_below_the_first_is_refused():
    text = written(lecroy, n=20)
    with pytest.raises(RecordingError, match=r"^line 26"):
        read(text + text)


def test_whole_tables_are_not_read_cell_by_cell(monkeypatch):
    """Of a million rows that would take long."""

    def slow(*_):
        raise AssertionError("read cell by cell")

    monkeypatch.setattr(table.Table, "_one_by_one", slow)
    for layout in LAYOUTS:
        assert len(read(written(layout, n=2000))) == 2000


# -- tables of simulations ------------------------------------------------------------------


def test_a_current_of_ltspice_is_in_A_and_a_unit_in_parentheses_is_a_unit():
    rows = "0\t1\t2\t3\n1e-4\t4\t5\t6\n"
    rec = read("time\tI(L1)\tId(M1)\tI(mA)\n" + rows)
    assert rec.units == {"I(L1)": "A", "Id(M1)": "A", "I": "A"}
    assert rec["I"].tolist() == pytest.approx([3e-3, 6e-3])


def test_spaces_separate_columns_where_nothing_else_does():
    """PSIM's table. Its name says nothing of the format, so a .json beside it is not its header."""
    times, columns = 1e-4 * np.arange(40), np.random.default_rng(3).normal(size=(2, 40))
    rows = ["".join(f"{value:16.7E}" for value in row) for row in zip(times, *columns)]
    rec = read("\n".join(["   Time        I1      V2", *rows, ""]))
    assert list(rec.channels) == ["I1", "V2"] and rec.rate_Hz == 10e3
    np.testing.assert_allclose(rec["V2"], columns[1], rtol=1e-6)
    rows[7] = rows[7].replace("E", "X", 1)
    with pytest.raises(RecordingError, match=r"^line 9, Time: .* is not a number"):
        read("\n".join(["Time I1 V2", *rows]))
    del rows[7]
    with pytest.raises(RecordingError, match=r"^line 3: 2 cells where there are 3"):
        read("\n".join(["Time I1 V2", rows[0], rows[1][:32], *rows[2:]]))


@pytest.mark.parametrize("ending", [".txt", ".TXT", ".tsv"])
def test_a_table_under_another_suffix_is_read_and_never_written(ending, tmp_path):
    path = tmp_path / f"run{ending}"
    path.write_text(written(ltspice))
    (tmp_path / "run.json").write_text('{"rate_Hz": 1, "units": {}, "meta": {}}')
    rec = Recording.load(path)
    assert list(rec.channels) == ["V(n0)", "V(n1)"]
    assert rec.notes[0].startswith("a table of another program: ")
    with pytest.raises(RecordingError, match="unknown suffix, use"):
        rec.save(path)
