"""Reports that compare runs with published values: tables for the console and one HTML file."""

from __future__ import annotations

import base64
from collections.abc import Callable, Iterable, Sequence
from html import escape
from pathlib import Path
from typing import NamedTuple

from rich.box import SIMPLE
from rich.table import Table
from rich.text import Text

from .. import __version__
from .reference import Reference, reference_values
from .run import LATENCY_STUDY, Run, by_point


class Column(NamedTuple):
    """A column of the result tables. paper: its key among the paper's values."""

    name: str
    unit: str
    digits: int
    value: Callable[[Run], float | None]
    paper: str = ""
    brief: bool = True  #: also on the console
    scale: float = 1.0


def _metric(key: str, band: str = "") -> Callable[[Run], float | None]:
    return lambda run: run.metrics[key][band] if band else run.metrics[key]


COLUMNS = (
    Column("speed", "r/min", 0, _metric("speed_rpm")),
    Column("torque", "N m", 2, _metric("torque_Nm")),
    Column("ripple", "N m", 3, _metric("torque_ripple_Nm"), "torque_ripple_Nm"),
    Column("Td", "N m", 3, _metric("torque_ripple_td_Nm"), brief=False),
    Column("THD 1k", "%", 1, _metric("thd_pct", "1kHz")),
    Column("THD 2k", "%", 1, _metric("thd_pct", "2kHz"), brief=False),
    Column("THD 5k", "%", 1, _metric("thd_pct", "5kHz"), "thd_pct"),
    Column("THD h≤50", "%", 1, _metric("thd_pct", "h50"), brief=False),
    Column("THD∞", "%", 2, _metric("thd_inf_pct"), brief=False),
    Column("5th", "%", 2, _metric("h5_pct"), brief=False),
    Column("7th", "%", 2, _metric("h7_pct"), brief=False),
    Column("i_xy rms", "A", 3, _metric("ixy_rms_A"), brief=False),
    Column("ΔI", "A", 3, _metric("delta_i_A"), "delta_i_A"),
    Column("f_sw", "kHz", 2, _metric("f_sw_Hz"), "f_sw_Hz", scale=1e-3),
    Column("f_sw", "× DTC1", 2, lambda run: None, "f_sw_rel"),
    Column("speed-up", "× real", 1, lambda run: run.realtime_factor, brief=False),
)
TITLE = "Direct torque control of six-phase drives"
THD_NOTE = (
    "THD of phase u1; ripple is a standard deviation at the control instants, Td over all "
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
    return "–" if value is None else f"{scale * value:.{digits}f}"


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
                value = column.value(run)
                if column.paper == "f_sw_rel" and (base_Hz := dtc1_Hz.get(run.latency)):
                    value = (run.metrics["f_sw_Hz"] or 0) / base_Hz or None
                cells.append(_text(value, column.digits, column.scale))
            rows.append((False, cells))
        if measured:
            beside = [(measured.get(c.paper), c.scale) for c in columns]
            cells = ["" if v is None else f"{scale * v:.4g}" for v, scale in beside]
            rows.append((True, [scheme.upper(), "paper", *cells]))
    return rows


def _columns(group: list[Run], brief: bool) -> list[Column]:
    relative = any(run.scheme == "dtc1" for run in group)
    return [c for c in COLUMNS if c.brief >= brief and (relative or c.paper != "f_sw_rel")]


def _heading(group: list[Run], reference: Reference) -> str:
    if not any(reference_values(reference, run) for run in group):
        return group[0].point
    return f"{group[0].point} (beside {reference[group[0].setup].get('source', 'the paper')})"


def console_table(runs: list[Run], reference: Reference) -> list[Table]:
    """A rich table per set-up and point; the paper's figures as a dim row under the scheme's."""
    tables = []
    for group in by_point(runs).values():
        columns = _columns(group, brief=True)
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


def _table(headings: Iterable[str], rows: Iterable[Row]) -> str:
    head = "".join(f"<th>{escape(text)}</th>" for text in headings)
    body = ""
    for is_paper, cells in rows:
        data = "".join(f"<td>{escape(cell)}</td>" for cell in cells)
        body += f"<tr{' class=paper' if is_paper else ''}>{data}</tr>\n"
    return f"<div class=wide><table><tr>{head}</tr>\n{body}</table></div>\n"


def _latency_section(runs: list[Run]) -> str:
    """Torque ripple by latency, for every scheme run both with and without prediction."""
    ripple: dict[tuple, dict[str, float | None]] = {}
    for run in sorted(runs, key=lambda run: run.scheme != "fdr"):
        key = (run.point, run.scheme_label)
        ripple.setdefault(key, {})[run.latency] = run.metrics["torque_ripple_Nm"]
    rows = []
    for key, by_latency in ripple.items():
        shadow, predicted = by_latency.get("shadow"), by_latency.get("predicted")
        if shadow is not None and predicted:
            values = [_text(by_latency.get(latency), 3) for latency in LATENCY_STUDY]
            rows.append((False, [*key, *values, f"{shadow / predicted:.2f}"]))
    if not rows:
        return "<p>No scheme here was run both with and without prediction.</p>\n"
    columns = [f"{name} [N m]" for name in LATENCY_STUDY]
    headings = ["set-up", "scheme", *columns, "shadow / predicted"]
    return f"<p>{escape(LATENCY_TEXT)}</p>\n{_table(headings, rows)}"


def html_report(
    path: str | Path,
    runs: list[Run],
    reference: Reference,
    figures: Sequence[tuple[str, str | Path]] = (),
    notes: Sequence[str] = (),
    command: str = "make demo",
) -> Path:
    """Write one self-contained HTML file; returns its path. figures: (caption, PNG file);
    notes: paragraphs; command: what reproduces the report. All text is escaped."""
    groups = by_point(runs)
    part = [f"<h1>{TITLE}</h1>\n<p class=sub>{len(runs)} simulated runs in "
            f"{len(groups)} operating points, hexatorque {escape(__version__)}</p>\n"
            "<h2>What was run</h2>\n<ul>\n"]  # fmt: skip
    for point, group in groups.items():
        labels = ", ".join(dict.fromkeys(run.scheme_label for run in group))
        latencies = ", ".join(dict.fromkeys(run.latency for run in group))
        seconds = min(run.recording.duration_s for run in group)
        text = f"{labels}; latency {latencies}; {seconds:.3g} s evaluated"
        part.append(f"<li><b>{escape(point)}</b>: {escape(text)}</li>\n")
    part.append("</ul>\n<h2>Results</h2>\n")
    for group in groups.values():
        columns = _columns(group, brief=False)
        headings = ["scheme", "latency", *(f"{c.name} [{c.unit}]" for c in columns)]
        table = _table(headings, _rows(group, reference, columns))
        part.append(f"<h3>{escape(_heading(group, reference))}</h3>\n{table}")
    part.append(f"<p class=sub>{escape(THD_NOTE)}</p>\n<h2>What latency does</h2>\n")
    part += [_latency_section(runs), "<h2>Figures</h2>\n" if figures else ""]
    for caption, file in figures:
        source = f"data:image/png;base64,{base64.b64encode(Path(file).read_bytes()).decode()}"
        part.append(f'<figure><img alt="{escape(caption)}" src="{source}">\n'
                    f"<figcaption>{escape(caption)}</figcaption></figure>\n")  # fmt: skip
    part += ["<h2>Notes</h2>\n" if notes else "", *(f"<p>{escape(n)}</p>\n" for n in notes)]
    part.append(f"<h2>How to reproduce</h2>\n<pre>{escape(command)}</pre>\n")
    page = ('<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
            '<meta name="viewport" content="width=device-width, initial-scale=1">'
            f"<title>{TITLE}</title><style>{STYLE}</style></head>\n"
            f"<body><main>\n{''.join(part)}</main></body></html>\n")  # fmt: skip
    Path(path).parent.mkdir(parents=True, exist_ok=True)
    Path(path).write_text(page, encoding="utf-8")
    return Path(path)


STYLE = """
:root{color-scheme:light dark;--ink:#20242b;--faint:#666d78;--line:#d9dde3;--back:#fff}
@media(prefers-color-scheme:dark){:root{--ink:#e4e7eb;--faint:#9aa1ab;--line:#3a4049;--back:#16191e}}
body{margin:0;background:var(--back);color:var(--ink);font:16px/1.5 system-ui,sans-serif}
main{max-width:1180px;margin:0 auto;padding:2rem 1.2rem}h1{margin:0;line-height:1.2}
h2{margin:2.2rem 0 .6rem;border-bottom:1px solid var(--line)}h3{margin:1.4rem 0 .4rem}
.sub,.paper td,figcaption{color:var(--faint)}.paper td{font-style:italic}.wide{overflow-x:auto}
table{border-collapse:collapse;font-size:.86rem;font-variant-numeric:tabular-nums}
th,td{padding:.25rem .5rem;text-align:right;border-bottom:1px solid var(--line)}th{font-weight:600}
td:nth-child(-n+2),th:nth-child(-n+2){text-align:left;white-space:nowrap}
figure{margin:1.2rem 0}img{width:100%;height:auto;background:#fff;border-radius:6px}
pre{border:1px solid var(--line);border-radius:6px;padding:.7rem 1rem;overflow:auto}"""
