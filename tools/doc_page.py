"""What the tools share that renew the generated parts of a documentation page, and the data beside
it."""

from __future__ import annotations

import csv
import json
import re
from collections.abc import Iterable
from pathlib import Path

BEGIN, END = "<!-- generated: {} -->\n", "<!-- end of {} -->\n"


def renew(text: str, part: str, content: str) -> str:
    """The page's text with one generated part replaced."""
    begin, end = BEGIN.format(part), END.format(part)
    head, rest = text.split(begin)
    return head + begin + content + end + rest.split(end)[1]


def renew_page(
    page: Path, parts: dict[str, str], pictures: Iterable[str] = (), folder: Path = Path()
) -> None:
    """Writes the parts into the page, and keeps those pictures that are in the folder."""
    text = page.read_text()
    for part, content in parts.items():
        text = renew(text, part, content)
    page.write_text(text)
    for name in pictures:
        picture = folder / f"{name}.png"
        if picture.exists():
            keep(picture, page.parent / "images")


def keep(picture: Path, folder: Path) -> None:
    """Copies a picture with 64 colours, which lines and text do not need more of: a repository
    keeps every version of it."""
    from PIL import Image  # only some tools have pictures

    colours = Image.open(picture).convert("RGB").quantize(64, dither=Image.Dither.NONE)
    colours.save(folder / picture.name, optimize=True)


def read_whole(path: Path) -> dict:
    """The result of a full run."""
    result: dict = json.loads(path.read_text())
    if result["quick"]:
        raise SystemExit(f"{path}: a quick run; the documentation shows full ones")
    return result


def read_figures(folder: Path, names: list[str]) -> dict[str, dict] | None:
    """The figures, or None if not all of them are there."""
    paths = [folder / f"{name}.json" for name in names]
    if not all(path.exists() for path in paths):
        return None
    return {name: read_whole(path) for name, path in zip(names, paths)}


def row(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def keep_data(
    page: Path, name: str, heads: list[str], rows: Iterable[Iterable[str]], words: str = ""
) -> str:
    """Writes a whole table beside the pages, as data. The site shows it as a page of its own.
    Returns a link to it, for this page. Marks of the page's language are left out."""
    path = page.parent / "data" / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)
    with path.open("w", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(heads)
        writer.writerows([plain(cell) for cell in row] for row in rows)
    return f"[{words or path.name}](data/{path.name})"


def read_data(page: Path, name: str) -> list[list[str]]:
    """The rows that `keep_data` wrote, the heads first."""
    with (page.parent / "data" / f"{name}.csv").open() as file:
        return list(csv.reader(file))


def plain(cell: str) -> str:
    """The text of a table's cell without marks."""
    cell = re.sub(r"^`([^`]*)`$|^\*\*(.*)\*\*$", r"\1\2", cell.strip())
    return cell.replace("\\|", "|")


def table(heads: list[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """The lines of a table, without an empty one after it."""
    return [row(heads), "|---" * len(heads) + "|", *map(row, rows)]
