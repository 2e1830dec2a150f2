"""Reports are complete, self-contained and escaped."""

import base64
import io
from html.parser import HTMLParser

import pytest
from jinja2 import UndefinedError
from rich.console import Console

from hexatorque.analysis import plots
from hexatorque.analysis.pages import write_page
from hexatorque.analysis.report import console_table, html_report
from hexatorque.evidence.papers.printed_values import PAPER

VOID = {"meta", "img", "br"}


class Page(HTMLParser):
    """A parser that checks nesting and collects text, table rows and attributes."""

    def __init__(self, text):
        super().__init__()
        self.stack, self.text, self.rows, self.attributes, self.tags = [], "", [], [], []
        self.feed(text)
        self.close()
        assert self.stack == []

    def handle_starttag(self, tag, attrs):
        self.tags.append(tag)
        self.attributes += attrs
        if tag not in VOID:
            self.stack.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.stack.pop() == tag

    def handle_data(self, data):
        if "style" in self.stack:
            return
        self.text += data
        if self.stack and self.stack[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.fixture
def runs(make_run):
    ripple = {"none": 0.2, "shadow": 0.5, "predicted": 0.25}
    point_a = {"setup": "paper-a-feasible", "speed_ref_rpm": 100.0, "load_Nm": 10.0}
    return [
        *(make_run(scheme="fdr", latency=name, ripple_Nm=nm) for name, nm in ripple.items()),
        make_run(scheme="dtc1", meta={"f_sw_Hz": 2000.0}),
        make_run(scheme="dtc3", meta={"f_sw_Hz": 3000.0}, ripple_Nm=0.11),
        make_run(scheme="ddr", **point_a, amplitude_A=(2.0, 1.97)),
    ]


def console(tables, width=80):
    out = Console(file=io.StringIO(), width=width)
    for table in tables:
        out.print(table)
    return out.file.getvalue()


def test_console_shows_ours_and_the_papers(runs):
    tables = console_table(runs, PAPER)
    assert len(tables) == 2
    text = console(tables)
    lines = [line.split() for line in text.splitlines()]
    assert ["DTC3", "paper", "0.1063", "12.9", "2"] in lines
    assert ["DDR", "paper", "8.13", "0.0309", "2.48"] in lines
    ours = next(line for line in lines if line[:2] == ["DTC3", "predicted"])
    assert ours == ["DTC3", "predicted", "0.0", "0.110", "10.4", "10.44", "0.000", "3.00", "1.50"]
    assert ["FDR", "paper"] not in [line[:2] for line in lines]  # paper B did not run FDR
    assert "paper-b: 2500 r/min, 2 N m (beside paper B, Table VI)" in text
    assert lines[3][2:5] == ["%", "N", "m"] and "…" not in text


def test_the_console_has_room_for_every_column(make_run):
    """Td and the mean torque's error too, with two digits before the point."""
    run = make_run(scheme="db-dtfc", meta={"f_sw_Hz": 10e3, "samples_per_period": 12})
    run.metrics |= {"torque_error_pct": -14.83, "thd_inf_pct": 70.46, "torque_ripple_Nm": 12.5}
    run.metrics["thd_pct"]["5kHz"] = 68.7
    text = console(console_table([run, make_run(scheme="dtc1")], {}))
    assert "…" not in text and "-14.8" in text and "Td" in text
    assert max(map(len, text.splitlines())) <= 80


def test_an_error_of_almost_nothing_has_no_sign(make_run):
    run = make_run()
    run.metrics["torque_error_pct"] = -0.01
    assert "-0.0" not in console(console_table([run], {}))


def test_console_omits_the_paper_at_other_points(make_run):
    text = console(console_table([make_run(scheme="dtc1", load_Nm=1.0)], PAPER))
    assert "paper " not in text and "beside" not in text


def test_console_does_not_interpret_names_as_markup(make_run):
    assert "[red]x" in console(console_table([make_run(setup="[red]x")], {}))


def test_html_is_one_self_contained_file(runs, tmp_path):
    figure = plots.bars(runs, tmp_path / "bars.png", PAPER)
    path = html_report(tmp_path / "new" / "r.html", runs, PAPER, [("Overview", figure)])
    text = path.read_text(encoding="utf-8")
    page = Page(text)
    assert "http" not in text and "<script" not in text and "@import" not in text
    assert {"link", "script", "iframe"}.isdisjoint(page.tags)
    sources = [value for name, value in page.attributes if name in ("src", "href")]
    assert len(sources) == 1
    kind, data = sources[0].split(",", 1)
    assert kind == "data:image/png;base64"
    assert base64.b64decode(data, validate=True) == figure.read_bytes()
    assert "prefers-color-scheme: dark" in text


def test_html_has_its_sections_and_notes(runs, tmp_path):
    path = html_report(tmp_path / "r.html", runs, PAPER, notes=["A note."])
    page = Page(path.read_text(encoding="utf-8"))
    for heading in ("What was run", "Results", "What latency does", "How to reproduce", "A note."):
        assert heading in page.text
    assert "make demo" in page.text


def test_html_tables_hold_the_numbers(runs, tmp_path):
    page = Page(html_report(tmp_path / "r.html", runs, PAPER).read_text(encoding="utf-8"))
    named = {tuple(row[:2]): row for row in page.rows}
    assert {"0.2617", "23.5", "1"} <= set(named["DTC1", "paper"])
    assert {"8.13", "0.0309", "2.48"} <= set(named["DDR", "paper"])
    assert "0.030 ± 0.000" in named["DDR", "predicted"]
    widths = {len(row) for row in page.rows if row[1] in ("paper", "predicted", "latency")}
    assert len(widths) <= 2  # paper A's table has no column relative to DTC1
    latency = named["paper-b: 2500 r/min, 2 N m", "FDR-DTC"]
    assert latency[2:] == ["0.200", "0.500", "0.250", "2.00"]


def test_a_column_that_nobody_has_a_value_for_is_left_out(make_run, tmp_path):
    """Td needs ten samples a period, the losses an inverter: this recording has neither. A value of
    the paper keeps its column."""
    run = make_run(scheme="dtc1")
    run.metrics["torque_ripple_Nm"] = None
    page = Page(html_report(tmp_path / "r.html", [run], PAPER).read_text(encoding="utf-8"))
    headings = next(row for row in page.rows if row[0] == "scheme")
    assert {"Td [N m]", "P conduction [W]", "P switching [W]"}.isdisjoint(headings)
    assert {"ripple [N m]", "f_sw [kHz]", "f_sw [× DTC1]"} <= set(headings)
    cells = [row for row in page.rows if row[0] == "DTC1"]
    assert all(any(column) for column in zip(*cells, strict=True))


def test_html_begins_with_what_the_figures_say(runs, tmp_path):
    page = Page(html_report(tmp_path / "r.html", runs, PAPER).read_text(encoding="utf-8"))
    first = page.text.index("paper-b: 2500 r/min, 2 N m: DTC3 has ")
    assert first < page.text.index("What was run")
    assert "makes FDR's torque ripple 2.50 times that without latency" in page.text


def test_html_without_a_latency_comparison_says_so(make_run, tmp_path):
    text = html_report(tmp_path / "r.html", [make_run()], PAPER).read_text(encoding="utf-8")
    assert "both with and without prediction" in text
    assert "<h2>Figures" not in text and "<h2>Notes" not in text


def test_html_escapes_everything(make_run, runs, tmp_path):
    bad = '<img src=x onerror="alert(1)">&'
    figure = plots.bars(runs, tmp_path / "f.png", PAPER)
    path = html_report(
        tmp_path / "r.html",
        [make_run(setup=bad, scheme="<b>", latency=name) for name in ("shadow", "predicted")],
        {bad: {"source": bad, "schemes": {"<b>": {"thd_pct": 1.0}}}},
        [(bad, figure)],
        [bad],
        command=bad,
    )
    page = Page(path.read_text(encoding="utf-8"))
    assert page.tags.count("img") == 1
    assert "onerror" not in dict(page.attributes)
    # Sentence, run list, heading (point, source), latency table, caption, note, command.
    assert page.text.count(bad) == 8


def test_a_value_that_a_template_lacks_is_an_error(tmp_path):
    """Without this, a misspelt name would be an empty place in the report."""
    with pytest.raises(UndefinedError, match="count"):
        write_page(tmp_path / "r.html", "comparison.html", title="A report")
    assert not (tmp_path / "r.html").exists()


def test_missing_figures_of_merit_show_as_a_dash(make_run, tmp_path):
    run = make_run(scheme="dtc1", rate_Hz=3000.0, meta={})
    page = Page(html_report(tmp_path / "r.html", [run], PAPER).read_text(encoding="utf-8"))
    row = next(row for row in page.rows if row[:2] == ["DTC1", "predicted"])
    # 5 kHz and relative f_sw, which the paper prints. The others have no column.
    assert row.count("–") == 2
