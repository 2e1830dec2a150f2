"""One HTML page with all reproduced figures. It can be opened from disk."""

from __future__ import annotations

import math
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING

from .... import __version__
from ....analysis.report import STYLE
from ....setups import show
from .figure import VERDICTS

if TYPE_CHECKING:
    from rich.table import Table

PAPERS = (
    ("A", "Paper A: Holakooie, Iwanski, Miazga 2022"),
    ("B", "Paper B: Pandit, Aware, Nemade, Levi 2017"),
    ("", "Both papers"),
)


def number(value: float | str | None) -> str:
    """A number of a verdict table, with four significant digits."""
    if value is None:
        return "–"
    if isinstance(value, str):
        return value
    if isinstance(value, bool):
        return "yes" if value else "no"
    if value == 0 or not math.isfinite(value):
        return f"{value:g}"
    digits = max(0, 4 - math.floor(math.log10(abs(value))) - 1)
    return f"{value:.{digits}f}" if abs(value) < 1e5 else f"{value:.3g}"


def with_unit(value: float | str | None, unit: str) -> str:
    text = number(value)
    return f"{text} {unit}" if unit and value is not None else text


def counts(figures: dict[str, dict]) -> dict[str, int]:
    """The number of each kind of verdict, in the order of VERDICTS."""
    words = [row["verdict"] for data in figures.values() for row in data["verdicts"]]
    return {word: words.count(word) for word in VERDICTS}


def console_table(figures: dict[str, dict]) -> Table:
    """The verdicts as tables for the terminal."""
    from rich.table import Table
    from rich.text import Text

    colour = dict(zip(VERDICTS, ("green", "green", "red", "red", "dim")))
    many = ", ".join(f"{count} {word}" for word, count in counts(figures).items() if count)
    table = Table(title=f"verdicts: {many}", title_justify="left")
    for heading in ("figure", "what", "ours", "paper", "verdict"):
        table.add_column(heading)
    for name, data in figures.items():
        for v in data["verdicts"]:
            ours, paper = (Text(with_unit(v[key], v["unit"])) for key in ("ours", "paper"))
            word = Text(v["verdict"], colour[v["verdict"]])
            table.add_row(name, Text(v["what"]), ours, paper, word)
        table.add_section()
    return table


def _rows(name: str, verdicts: list[dict], link: bool) -> str:
    rows = []
    for v in verdicts:
        word = v["verdict"]
        where = f'<td><a href="#{name}">{name}</a></td>' if link else ""
        rows.append(
            f'<tr data-v="{word}">{where}<td>{escape(v["what"])}</td>'
            f"<td>{escape(with_unit(v['ours'], v['unit']))}</td>"
            f"<td>{escape(with_unit(v['paper'], v['unit']))}</td>"
            f'<td><b class="v {word.replace(" ", "-")}">{word}</b></td>'
            f"<td>{escape(v['why'])}</td></tr>\n"
        )
    return "".join(rows)


def _table(body: str, link: bool) -> str:
    head = "<th>figure</th>" if link else ""
    return (
        f"<div class=wide><table class=verdicts><thead><tr>{head}<th>what</th><th>ours</th>"
        f"<th>paper</th><th>verdict</th><th>why</th></tr></thead><tbody>\n{body}</tbody></table></div>\n"
    )


def _values(values: dict) -> str:
    return ", ".join(f"{escape(k)} = {escape(show(v))}" for k, v in values.items())


def _figure(name: str, data: dict) -> str:
    parts = [
        f'<section id="{name}"><h3>{name} · {escape(data["title"])}</h3>\n',
        f'<figure><a href="{name}.png"><img loading=lazy alt="{escape(data["title"])}" '
        f'src="{name}.png"></a>\n<figcaption>{escape(data["caption"])}</figcaption></figure>\n',
    ]
    if data["verdicts"]:
        parts.append(_table(_rows(name, data["verdicts"], False), False))
    if data["setup"]:
        seen: dict[str, dict] = {}
        for setup in data["setup"]:
            seen.setdefault(setup["name"], setup["assumed"])
        lines = "".join(
            f"<p><b>{escape(setup)}</b>, assumed because not printed: {_values(values)}</p>"
            for setup, values in seen.items()
        )
        runs = "".join(
            f"<li>{escape(s['name'])}: {_values(s['set']) or 'as it is'}</li>"
            for s in data["setup"]
        )
        parts.append(
            f"<details><summary>set-up: {', '.join(map(escape, seen))}</summary>{lines}"
            f"<p>Set for this figure:</p><ul>{runs}</ul></details>\n"
        )
    files = [f"{name}.json", *data["recordings"]]
    links = " · ".join(f'<a href="{file}">{file}</a>' for file in files)
    parts.append(f"<p class=sub>{links}</p></section>\n")
    return "".join(parts)


def write_page(path: Path, figures: dict[str, dict], failed: dict[str, str]) -> Path:
    """The page. figures: identifier -> contents of its JSON file, in the order of the page."""
    many = counts(figures)
    buttons = "".join(
        f'<button data-f="{word}">{word} <span>{count}</span></button>'
        for word, count in many.items()
    )
    body = [
        "<h1>Two papers, reproduced</h1>\n"
        f"<p class=sub>{len(figures)} figures and tables made by the firmware in simulation, "
        f"hexatorque {escape(__version__)}"
        f"{', quick' if any(d['quick'] for d in figures.values()) else ''}</p>\n"
    ]
    for name, reason in failed.items():
        body.append(f"<p><b>{name} failed:</b> {escape(reason)}</p>\n")
    body.append(
        f'<h2>Verdicts</h2>\n<p id=filter><button data-f="" class=on>all '
        f"<span>{sum(many.values())}</span></button>{buttons}</p>\n"
    )
    body.append(_table("".join(_rows(n, d["verdicts"], True) for n, d in figures.items()), True))
    for letter, heading in PAPERS:
        own = {n: d for n, d in figures.items() if (n[0] if n[0] in "AB" else "") == letter}
        if own:
            jump = " ".join(f'<a href="#{name}">{name}</a>' for name in own)
            body.append(f"<h2>{heading}</h2>\n<p class=jump>{jump}</p>\n")
            body += [_figure(name, data) for name, data in own.items()]
    page = (
        '<!doctype html>\n<html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>Two papers, reproduced</title><style>{STYLE}{PAGE_STYLE}</style></head>\n"
        f"<body><main>\n{''.join(body)}</main><script>{SCRIPT}</script></body></html>\n"
    )
    path.write_text(page, encoding="utf-8")
    return path


PAGE_STYLE = """
.verdicts td,.verdicts th{text-align:left;white-space:normal;vertical-align:top}
.verdicts td:nth-child(1){white-space:nowrap}
section{margin:2.5rem 0}details{font-size:.86rem;color:var(--faint)}.jump a{margin-right:.5rem}
#filter button{font:inherit;font-size:.86rem;margin:0 .4rem .4rem 0;padding:.15rem .7rem;
border:1px solid var(--line);border-radius:1rem;background:none;color:inherit;cursor:pointer}
#filter button.on{border-color:currentColor;font-weight:600}#filter span{color:var(--faint)}
.v{font-weight:600;white-space:nowrap}.match,.better{color:#1a7f4b}.worse,.differs{color:#c2410c}
.not-printed{color:var(--faint)}
@media(prefers-color-scheme:dark){.match,.better{color:#4ade80}.worse,.differs{color:#fb923c}
a{color:#7cb7ff}}"""

SCRIPT = """
const buttons=document.querySelectorAll('#filter button');
buttons.forEach(b=>b.onclick=()=>{const want=b.dataset.f;
buttons.forEach(x=>x.classList.toggle('on',x===b));
document.querySelectorAll('.verdicts tr[data-v]').forEach(r=>{r.hidden=want&&r.dataset.v!==want});
document.querySelectorAll('section').forEach(s=>{const rows=s.querySelectorAll('tr[data-v]');
s.hidden=want&&![...rows].some(r=>!r.hidden)})});"""
