"""Reports that compare runs with published values: tables for the console and one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.box import SIMPLE
from rich.table import Table
from rich.text import Text

from .pages import write_page
from .reference import Reference, reference_values
from .run import LATENCY_STUDY, Run, by_point
from .saying import sentences


class Column(NamedTuple):
    """A column of the result tables. paper: its key among the paper's values."""

    name: str
    unit: str
    digits: int
    value: Callable[[Run], float | None]
    paper: str = ""
    brief: bool = True  #: also on the console
    scale: float = 1.0
    spread: str = ""  #: metric that is the value's standard deviation

    def text(self, run: Run) -> str:
        value = self.value(run)
        shown = _text(value, self.digits, self.scale)
        spread = run.metrics.get(self.spread) if self.spread else None
        if value is None or spread is None:
            return shown
        return f"{shown} ± {_text(spread, self.digits, self.scale)}"


def _metric(key: str, band: str = "") -> Callable[[Run], float | None]:
    return lambda run: run.metrics[key][band] if band else run.metrics[key]


COLUMNS = (
    Column("speed", "r/min", 0, _metric("speed_rpm"), brief=False),
    Column("torque", "N m", 2, _metric("torque_Nm"), brief=False),
    Column("T err", "N m", 2, _metric("torque_error_Nm"), brief=False),
    Column("T err", "%", 1, _metric("torque_error_pct")),
    Column("ripple", "N m", 3, _metric("torque_ripple_Nm"), "torque_ripple_Nm"),
    Column("Td", "N m", 3, _metric("torque_ripple_td_Nm")),
    Column("THD 1k", "%", 1, _metric("thd_pct", "1kHz"), brief=False),
    Column("THD 2k", "%", 1, _metric("thd_pct", "2kHz"), brief=False),
    Column("THD 5k", "%", 1, _metric("thd_pct", "5kHz"), "thd_pct"),
    Column("THD h≤50", "%", 1, _metric("thd_pct", "h50"), brief=False),
    Column("THD∞", "%", 2, _metric("thd_inf_pct")),
    Column("5th", "%", 2, _metric("h5_pct"), brief=False),
    Column("7th", "%", 2, _metric("h7_pct"), brief=False),
    Column("i_xy rms", "A", 3, _metric("ixy_rms_A"), brief=False),
    Column("ΔI", "A", 3, _metric("delta_i_A"), "delta_i_A", spread="delta_i_spread_A"),
    Column("i_dc ripple", "A", 3, _metric("idc_ripple_A"), brief=False),
    Column("P copper", "W", 2, _metric("copper_loss_W"), brief=False),
    Column("P conduction", "W", 2, _metric("conduction_loss_W"), brief=False),
    Column("P switching", "W", 2, _metric("switching_loss_W"), brief=False),
    Column("f_sw", "kHz", 2, _metric("f_sw_Hz"), "f_sw_Hz", scale=1e-3),
    Column("f_sw", "× DTC1", 2, lambda run: None, "f_sw_rel"),
)
TITLE = "Direct torque control of six-phase drives"
THD_NOTE = (
    "T err: mean torque less its reference, negative if the drive holds less than it is asked "
    "for. THD of phase u1; ripple is a standard deviation at the control instants, Td over all "
    "samples; THD∞ is of all six phases and has no band. The papers do not state the band of their "
    "THD: it stands in the 5 kHz column."
)
LATENCY_TEXT = (
    "Torque ripple (standard deviation) when a switching decision reaches the inverter at once "
    "(none), when it arrives one sample late because the PWM unit takes its shadow registers over "
    "at the next period (shadow), and the same with a one-step prediction (predicted)."
)
Row = tuple[bool, list[str]]  #: is it the paper's; cells


def _text(value: float | None, digits: int, scale: float = 1.0) -> str:
    # Plus zero: no "-0.0".
    return "–" if value is None else f"{round(scale * value, digits) + 0.0:.{digits}f}"


def _rows(group: list[Run], reference: Reference, columns: Iterable[Column]) -> list[Row]:
    """Our runs at one point, scheme by scheme. The paper's row follows each scheme."""
    dtc1_Hz = {run.latency: run.metrics["f_sw_Hz"] for run in group if run.scheme == "dtc1"}
    rows = []
    for scheme in dict.fromkeys(run.scheme for run in group):
        own = [run for run in group if run.scheme == scheme]
        measured = reference_values(reference, own[0])
        for run in own:
            cells = [run.scheme.upper(), run.latency]
            for column in columns:
                if column.paper == "f_sw_rel" and (base_Hz := dtc1_Hz.get(run.latency)):
                    relative = (run.metrics["f_sw_Hz"] or 0) / base_Hz or None
                    cells.append(_text(relative, column.digits, column.scale))
                else:
                    cells.append(column.text(run))
            rows.append((False, cells))
        if measured:
            beside = [(measured.get(c.paper), c.scale) for c in columns]
            cells = ["" if v is None else f"{scale * v:.4g}" for v, scale in beside]
            rows.append((True, [scheme.upper(), "paper", *cells]))
    return rows


def _columns(group: list[Run], reference: Reference, brief: bool) -> list[Column]:
    """Those of which a run or the paper has a value. The console has 80 columns: the brief
    table leaves out what the title says, and spreads."""
    relative = any(run.scheme == "dtc1" for run in group)

    printed = {key for run in group for key in reference_values(reference, run)}

    def known(c: Column) -> bool:
        if c.paper == "f_sw_rel":
            return relative
        return c.paper in printed or any(c.value(run) is not None for run in group)

    shown = [c for c in COLUMNS if c.brief >= brief and known(c)]
    return [c._replace(spread="") for c in shown] if brief else shown


def _heading(group: list[Run], reference: Reference) -> str:
    if not any(reference_values(reference, run) for run in group):
        return group[0].point
    return f"{group[0].point} (beside {reference[group[0].setup].get('source', 'the paper')})"


def console_table(runs: list[Run], reference: Reference) -> list[Table]:
    """A rich table per set-up and point; the paper's figures as a dim row under the scheme's."""
    tables = []
    for group in by_point(runs).values():
        columns = _columns(group, reference, brief=True)
        table = Table(title=Text(_heading(group, reference), "bold"), title_justify="left",
                      box=SIMPLE, padding=(0, 1, 0, 0), pad_edge=False)  # fmt: skip
        table.add_column("scheme", no_wrap=True)
        table.add_column("latency", no_wrap=True)
        for c in columns:
            table.add_column(Text(f"{c.name}\n{c.unit}"), justify="right", no_wrap=True)
        for is_paper, cells in _rows(group, reference, columns):
            table.add_row(*map(Text, cells), style="dim" if is_paper else None)
        tables.append(table)
    return tables


def _latency_rows(runs: list[Run]) -> list[Row]:
    """Torque ripple by latency, for every scheme run both with and without prediction."""
    ripple: dict[tuple, dict[str, float | None]] = {}
    for run in sorted(runs, key=lambda run: run.scheme != "fdr"):
        key = (run.point, run.scheme_label)
        ripple.setdefault(key, {})[run.latency] = run.metrics["torque_ripple_Nm"]
    rows: list[Row] = []
    for key, by_latency in ripple.items():
        shadow, predicted = by_latency.get("shadow"), by_latency.get("predicted")
        if shadow is not None and predicted:
            values = [_text(by_latency.get(latency), 3) for latency in LATENCY_STUDY]
            rows.append((False, [*key, *values, f"{shadow / predicted:.2f}"]))
    return rows


def _what_was_run(group: list[Run]) -> str:
    labels = ", ".join(dict.fromkeys(run.scheme_label for run in group))
    factor = min(run.realtime_factor for run in group)
    latencies = ", ".join(dict.fromkeys(run.latency for run in group))
    seconds = min(run.recording.duration_s for run in group)
    return f"{labels}; latency {latencies}; {seconds:.3g} s evaluated; {factor:.3g} times real time"


def _result(group: list[Run], reference: Reference) -> tuple[str, list[str], list[Row]]:
    """Heading, headings of the columns and rows of one operating point."""
    columns = _columns(group, reference, brief=False)
    headings = ["scheme", "latency", *(f"{c.name} [{c.unit}]" for c in columns)]
    return _heading(group, reference), headings, _rows(group, reference, columns)


def picture_source(file: str | Path) -> str:
    """A PNG file as an address that holds the picture itself."""
    return f"data:image/png;base64,{base64.b64encode(Path(file).read_bytes()).decode()}"


def html_report(
    path: str | Path,
    runs: list[Run],
    reference: Reference,
    figures: Sequence[tuple[str, str | Path]] = (),
    notes: Sequence[str] = (),
    command: str = "make demo",
) -> Path:
    """Write one self-contained HTML file; returns its path. figures: (caption, PNG file);
    notes: paragraphs; command: what reproduces the report."""
    groups = by_point(runs)
    return write_page(
        Path(path),
        "comparison.html",
        title=TITLE,
        count=len(runs),
        says=sentences(runs, reference),
        points=[(point, _what_was_run(group)) for point, group in groups.items()],
        results=[_result(group, reference) for group in groups.values()],
        thd_note=THD_NOTE,
        latency_text=LATENCY_TEXT,
        latency_headings=[
            "set-up", "scheme", *(f"{name} [N m]" for name in LATENCY_STUDY), "shadow / predicted"
        ],
        latency_rows=_latency_rows(runs),
        figures=[(caption, picture_source(file)) for caption, file in figures],
        notes=notes,
        command=command,
    )  # fmt: skip
