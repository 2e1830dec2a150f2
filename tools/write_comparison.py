"""Renew the generated parts of docs/comparison.md and docs/interleaved.md from what `hexatorque
evidence papers references` and `hexatorque evidence limit` wrote into a folder, or one of them, and
from docs/budget.json.

Usage: write_comparison.py [OUT_DIR]

Without a folder only the table of instructions and memory and what db-ipwm reaches are renewed.
"""

from __future__ import annotations

import json
import math
import sys
from pathlib import Path

import doc_page

from hexatorque.evidence.cost.budget import PLACING
from hexatorque.evidence.methods import judging
from hexatorque.evidence.methods.methods import TABLE, methods
from hexatorque.evidence.methods.references import memory_bytes
from hexatorque.evidence.studies import limit as study

PAGE = Path("docs/comparison.md")
NAME = "REFERENCES"
LIMIT = "limit"
PICTURES = (NAME, f"{NAME}-others")
#: Of the page of db-ipwm.
INTERLEAVED = "interleaved"
#: Its ends of the knob, each with its figure, patterns of the limit, the target over the best of
#: the other methods, and columns of the fronts within less than SHOWN.
ENDS: tuple[tuple[str, str, str, tuple[str, ...], float, tuple[str, ...]], ...] = (
    ("db-ipwm smooth", "td_Nm", "Td", ("limit, w = 2", "limit, w = 32"), 0.85,
     ("Td ≤ 1 kHz", "Td ≤ 1.5 kHz", "Td ≤ 2 kHz", "Td ≤ 3 kHz")),
    ("db-ipwm clean", "thd_inf_pct", "THD∞", ("limit, w = 0",), 1.0, ()),
)  # fmt: skip
#: The methods that are forms of it.
FORMS = tuple(method.name for method in methods() if method.scheme == "db-ipwm")
MACHINE = "mps2-an386"
#: Within this limit one number of each figure is shown.
SHOWN = "4000"
#: Of the fronts' data, and of the limit's.
COLUMNS = {
    "td_Nm": (f"Td ≤ {float(SHOWN) / 1e3:g} kHz", "Td [N m]"),
    "thd_inf_pct": ("THD∞ [%]", "THD∞ [%]"),
}


def _tables(name: str, of: str, tables: dict[str, tuple[list[str], list[list[str]]]]) -> str:
    """A link to the tables as one file."""
    heads = list(dict.fromkeys(head for heads, _ in tables.values() for head in heads))
    every = [
        [title, *(dict(zip(own, row)).get(head, "") for head in heads)]
        for title, (own, rows) in tables.items()
        for row in rows
    ]
    columns = [of, "method", *heads[1:]]
    return f"All {len(tables)}: {doc_page.keep_data(PAGE, name, columns, every)}.\n"


def sentences(metrics: dict) -> str:
    lines = [f"{n}. {s['text']}" for n, s in enumerate(metrics["equal"]["sentences"], 1)]
    lines += ["", f"{metrics['settings']} settings of each method were tried at each point."]
    missing = [
        f"{', '.join(f'`{name}`' for name in s['missing'])} in *{s['key']}*"
        for s in metrics["equal"]["sentences"]
        if s["missing"]
    ]
    if missing:
        lines += ["", f"Not ranked, because a point is missing: {'; '.join(missing)}."]
    again = metrics.get("rivals")
    if again:
        lines += ["", *_again(metrics["equal"]["sentences"], again)]
    lines += ["", f"![The machines' points of medium voltage](images/{NAME}.png)"]
    return "\n".join(lines) + "\n"


def _again(first: list[dict], again: dict) -> list[str]:
    changed = [new for old, new in zip(first, again["sentences"]) if old["words"] != new["words"]]
    heads = ["sentence", "words", "relative to the best of", "equal budgets", "larger one"]
    rows = []
    for old, new in zip(first, again["sentences"]):
        said = "the same" if old["words"] == new["words"] else new["words"]
        rows += [
            [
                old["key"],
                said,
                family,
                f"{ratio:.2f}",
                f"{new['against'].get(family, math.nan):.2f}",
            ]
            for family, ratio in old["against"].items()
        ]
    return [
        f"With {again['times']} times the budget for all but our laws, {len(changed)} of "
        f"the {len(first)} sentences change. The figures, with equal budgets and with the larger "
        f"one: {doc_page.keep_data(PAGE, 'budgets', heads, rows)}."
    ]


def _best(at: dict, name: str, figure: str, limit: str) -> str:
    row = at["best"][name][figure][limit]
    return f"{row[figure]:.3g}" if row else "–"


def fronts(metrics: dict) -> str:
    tables = {}
    names = metrics["methods"]
    points = (metrics.get("rivals") or metrics["equal"])["points"]
    for at in points:
        limits = list(at["best"][names[0]]["td_Nm"])
        heads = ["", *(f"Td ≤ {float(limit) / 1e3:g} kHz" for limit in limits)]
        heads += ["THD∞ [%]", "x–y [A]", "loss [W]", "sampled at [kHz]"]
        rows = []
        for name in names:
            cells = [f"`{name}`", *(_best(at, name, "td_Nm", limit) for limit in limits)]
            current = at["best"][name]["thd_inf_pct"][SHOWN]
            ripple = at["best"][name]["td_Nm"][SHOWN]
            cells += [
                _best(at, name, "thd_inf_pct", SHOWN),
                f"{current['ixy_rms_A']:.3g}" if current else "–",
                _best(at, name, "loss_W", SHOWN),
                f"{ripple['f_isr_Hz'] / 1e3:.3g}" if ripple else "–",
            ]
            rows.append(cells)
        tables[f"{at['point']}, {at['m_pu']:.2f} V_dc"] = heads, rows
    picture = f"![The machines' points of low voltage](images/{NAME}-others.png)\n"
    return "\n".join([_tables("fronts", "point", tables), picture])


def _step(tests: dict, test: str) -> str:
    found = tests.get(test)
    if found is None:
        return "–"
    if "lost" in found:
        return "lost"
    if test == "torque step":
        up, down = found["rise_up_ms"], found["rise_down_ms"]
        return f"{up:.2f} · {down:.2f} ms · {found['overshoot_pct']:.0f} %"
    if test == "reversal":
        return f"{found['settling_ms']:.0f} ms · {found['overshoot_rpm']:.1f} r/min"
    return f"{found['deviation_rpm']:.1f} r/min · {found['peak_A']:.3g} A"


def sampling(metrics: dict) -> str:
    shown = (metrics.get("rivals") or metrics["equal"])["by_sampling"]
    limits = list(next(iter(shown.values())))
    rows = [
        [f"`{name}`", *("–" if value is None else f"{value:.2f}" for value in ratios.values())]
        for name, ratios in shown.items()
    ]
    heads = ["method", *(f"≤ {float(hz) / 1e3:g} kHz" for hz in limits)]
    return f"Every method: {doc_page.keep_data(PAGE, 'sampling', heads, rows)}.\n"


def steps(metrics: dict) -> str:
    tables = {}
    shown = metrics.get("rivals") or metrics["equal"]
    for machine, own in shown["steps"].items():
        tests = list(dict.fromkeys(test for made in own.values() for test in made))
        rows = [
            [f"`{name}`", *(_step(own.get(name, {}), test) for test in tests)]
            for name in metrics["methods"]
        ]
        tables[machine] = ["", *tests], rows
    return _tables("steps", "machine", tables)


def errors(metrics: dict) -> str:
    tables = {}
    shown = metrics.get("rivals") or metrics["equal"]
    for machine, own in shown["errors"].items():
        cases = list(next(iter(own.values())))
        rows = []
        for name in metrics["methods"]:
            row = shown["chosen"][machine][name]
            if row is None:
                rows.append([f"`{name}`", "–", *("–" for _ in cases)])
                continue
            cells = [f"{row['td_Nm']:.3g} · {row['thd_inf_pct']:.3g}"]
            for case in cases:
                found = own[name][case]
                lost = "refused" if "refused" in found else "lost" if "lost" in found else None
                cells.append(lost or f"{found['td_Nm']:.3g} · {found['thd_inf_pct']:.3g}")
            rows.append([f"`{name}`", *cells])
        tables[machine] = ["", "none", *cases], rows
    return _tables("errors", "machine", tables)


def costs(budget: dict) -> str:
    counted = budget[MACHINE]
    memory = memory_bytes()
    rows = []
    for method in methods():
        name, kind = (*method.name.split(), "")[:2]  # variants differ in parameters alone
        row = counted.get(name)
        if name == PLACING:  # where it takes most, at the ends of the knob that the method has
            smooth, clean = counted["placed"]
            ends = {"smooth": (smooth,), "clean": (clean,)}.get(kind, (smooth, clean))
            row = {key: max(end[key] for end in ends) for key in ("mean", "max")}
        name = method.name
        own = memory.get(name)
        rows.append(
            [
                f"`{name}`",
                f"{row['mean']:.0f}" if row else "–",
                f"{row['max']:.0f}" if row else "–",
                "in the firmware" if own is None else f"host, {own} bytes of its own",
            ]
        )
    where = doc_page.keep_data(PAGE, "costs", ["method", "mean", "max", "where, memory"], rows)
    sizes = budget["sizes"][MACHINE]
    return (
        f"Every method: {where}. The firmware with all its schemes: {sizes['code']} bytes of code, "
        f"{sizes['constants']} of constants, {sizes['drive']} of data for a drive.\n"
    )


def _relative(points: list[dict], one: str, other: str, figure: str) -> str:
    """The geometric mean of `one` over `other`, each at its best, at the points where both are."""
    ratios = []
    for at in points:
        rows = [at["best"][name][figure][SHOWN] for name in (one, other)]
        if all(rows):
            ratios.append(rows[0][figure] / rows[1][figure])
    if not ratios:
        return "–"
    mean = math.exp(sum(map(math.log, ratios)) / len(ratios))
    return f"{mean:.2f} ({min(ratios):.2f} … {max(ratios):.2f})"


def _data(name: str) -> list[dict[str, str]]:
    """The rows of the page's data."""
    head, *rows = doc_page.read_data(PAGE, name)
    return [dict(zip(head, row)) for row in rows]


def _over(own: dict[str, dict[str, str]], name: str, column: str) -> tuple[float, str]:
    """A method's figure at a point over the least of the methods that are not ours, and which one
    that is. own: method -> its row. Infinite without a setting."""
    cells = {n: row[column] for n, row in own.items() if n == name or n not in FORMS}
    figures = {n: math.inf if cell == "–" else float(cell) for n, cell in cells.items()}
    mine = figures.pop(name)
    best = min(figures, key=lambda n: figures[n])
    return mine / figures[best], best


def interleaved() -> str:
    """Both ends of db-ipwm's knob beside the best of the others and the limit, from the data that
    the pages have."""
    points: dict[str, dict[str, dict[str, str]]] = {}
    for row in _data("fronts"):
        points.setdefault(row["point"], {})[row["method"]] = row
    limits = {(row["point"], row["pattern"]): row for row in _data(LIMIT)}
    heads, told = ["point"], []
    lines = [[point] for point in points]
    for name, key, label, patterns, target, lower in ENDS:
        (column, of_limit), parts = COLUMNS[key], []
        found = [_over(own, name, column) for own in points.values()]
        met = sum(ratio <= target for ratio, _ in found)
        aim = f"target {target:.2f}: met at {met} of {len(points)} points"
        below = [[_over(own, name, at)[0] for own in points.values()] for at in lower]
        if below:
            met = sum(ratio <= target for ratios in below for ratio in ratios)
            aim += f", {met} of {len(below) * len(points)} within less"
        ratios = [ratio for ratio, _ in found]
        parts.append(f"{_span(ratios)} times the best of the other methods ({aim})")
        columns = [ratios, *below]
        for pattern in patterns:
            least = [limits[point.rpartition(", ")[0], pattern] for point in points]
            columns.append([
                float(own[name][column]) / float(row[of_limit])
                for own, row in zip(points.values(), least)
            ])  # fmt: skip
            mean = judging.geometric_mean(columns[-1])
            parts.append(f"{_span(columns[-1])}, in the mean {mean:.2f} times the {pattern}")
        told.append(f"- {label} of `{name}`: {'; '.join(parts)}.")
        heads += ["the best other", *(f"{of} over it" for of in (column, *lower))]
        heads += [f"{column} over {pattern}" for pattern in patterns]
        for line, (_, best), cells in zip(lines, found, zip(*columns)):
            line += [best, *(f"{ratio:.2f}" if math.isfinite(ratio) else "–" for ratio in cells)]
    link = doc_page.keep_data(PAGE, "targets", heads, lines, "Every point")
    return "\n".join([f"Within {float(SHOWN) / 1e3:g} kHz. {link}.", "", *told]) + "\n"


def _span(ratios: list[float]) -> str:
    return f"{min(ratios):.2f} to {max(ratios):.2f}"


def published(metrics: dict) -> str:
    """Statements that others print, and the same ratio here."""
    points = (metrics.get("rivals") or metrics["equal"])["points"]

    def both(one: str, other: str, where: str = "") -> str:
        own = [at for at in points if where in at["point"]]
        td, thd = (_relative(own, one, other, figure) for figure in ("td_Nm", "thd_inf_pct"))
        return f"`{one}` over `{other}`: Td {td}, THD∞ {thd}"

    five = (
        "At equal use of the inverter, single vectors have better figures than several in a period",
        "*Modelling* 7(1), 17, 2026, abstract; a five-phase machine",
        "; ".join(both("fcs-mpc", name) for name in ("lvv-mpc", "vv-mpc")),
    )
    machines = {at["point"].split(",")[0]: at["point"] for at in points}
    low = (
        "Few vectors in a period suffer where the stator's impedance is low, and are as good "
        "as more vectors where it is high",
        "*Machines* 12(2), 115, 2024, conclusions",
        "; ".join(f"{name}: {both('vv-mpc', 'lvv-mpc', name)}" for name in machines),
    )
    heads = ["what they state", "where", "here, within 4 kHz, each at its best (range over points)"]
    link = doc_page.keep_data(PAGE, "published", heads, [five, low])
    return f"Two statements of others, and the same ratios here: {link}.\n"


def limit(folder: Path) -> str:
    """The limit, with the methods of the page's fronts in its picture."""
    result = doc_page.read_whole(folder / f"{LIMIT}.json")
    ((_, heads, rows),) = study.grid(result)
    link = doc_page.keep_data(PAGE, LIMIT, heads, rows)
    family = {method.name: method.family for method in methods()}
    reached: dict[str, dict[str, tuple[float, float]]] = {}
    head, *fronts = doc_page.read_data(PAGE, "fronts")
    for row in fronts:
        one = dict(zip(head, row))
        cells = one["THD∞ [%]"], one[f"Td ≤ {float(SHOWN) / 1e3:g} kHz"]
        if family[one["method"]] != TABLE and "–" not in cells:
            point = one["point"].rpartition(", ")[0]
            reached.setdefault(point, {})[one["method"]] = float(cells[0]), float(cells[1])
    study.plot(result, folder / f"{LIMIT}.png", reached)
    return (
        f"The limit, and carrier modulation: {link}.\n"
        f"\n![The limit and what the methods reach](images/{LIMIT}.png)\n"
    )


def measured(folder: Path) -> dict[str, str]:
    parts = {}
    if found := doc_page.read_figures(folder, [NAME]):
        metrics = found[NAME]["metrics"]
        for part in (sentences, fronts, sampling, steps, errors, published):
            parts[part.__name__] = part(metrics)
    if (folder / f"{LIMIT}.json").exists():
        parts[LIMIT] = limit(folder)
    if not parts:
        raise SystemExit(f"{folder}: neither {NAME} nor {LIMIT} is there")
    return parts


def main() -> None:
    folder = Path(sys.argv[1]) if len(sys.argv) > 1 else None
    parts = measured(folder) if folder else {}
    parts["costs"] = costs(json.loads((PAGE.parent / "budget.json").read_text()))
    own = {part: parts.pop(part) for part in (LIMIT,) if part in parts}
    own[INTERLEAVED] = interleaved()
    doc_page.renew_page(PAGE, parts, PICTURES if folder else (), folder or Path())
    doc_page.renew_page(
        PAGE.with_stem(INTERLEAVED), own, (LIMIT,) if folder else (), folder or Path()
    )


if __name__ == "__main__":
    main()
