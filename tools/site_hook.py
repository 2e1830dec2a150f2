"""What the site has beyond the pages in docs/ (a hook of MkDocs, see mkdocs.yml).

- Pages from files at the root: README.md is the home page, CONTRIBUTING.md, CHANGELOG.md.
- Pages from the program itself: commands, Python names, parameters, channels, faults.
- Pages from the data beside the pages: each docs/data/NAME.csv is a table on a page of its own.
- The gallery: the scenarios and scripts in examples/, and its notebooks, executed.
- The drive in a browser, `live.html`, which the home page shows.
- Equations: a block ```math, and $`…`$ in a line, become MathML, which browsers draw without a
  script.
- A link out of docs/ (to code) becomes the file's path: the site holds pages only.
"""

from __future__ import annotations

import base64
import csv
import importlib
import inspect
import os
import re
import shutil
import subprocess
import sys
import time
import tomllib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import click

    from hexatorque.firmware import Parameter

ROOT = Path(__file__).resolve().parents[1]
EXAMPLES = ROOT / "examples"
DATA = ROOT / "docs" / "data"
#: The page with the drive.
LIVE = "live.html"
TELL_S = 2.5
#: Page of the site -> file at the root.
FROM_ROOT = {
    "index.md": "README.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
}
#: Room in hexatorque -> what of it the page "Python" shows, in this order.
PYTHON = {
    "experiments.steady": ("measure",),
    "analysis.run": ("Run",),
    "setups": ("load", "Setup", "Profile", "Value", "SetupError"),
    "drive.simulated": ("SimulatedDrive",),
    "drive.board": ("BoardDrive",),
    "drive.interface": ("DriveVerbs", "DriveFault"),
    "drive.trips": ("Trip",),
    "laws.law": ("Law", "record"),
    "laws.patterns": ("centred", "vector", "vectors"),
    "recording.recording": ("Recording",),
    "sweeps.study": ("Study",),
    "sweeps.space": ("Draw",),
    "sweeps.work": ("Runs",),
    "recording.writer": ("Writer",),
    "analysis.metrics": ("metrics",),
    "errors": ("InputError", "HexatorqueError"),
}


# --- MkDocs calls these -----------------------------------------------------------


#: The pages that are being made, and when the last line said how many.
_pages: set[str] = set()
_told_s = time.monotonic()


def tell(what: str, number: int, of: int) -> None:
    """How far the site is, in a line every few seconds."""
    global _told_s
    if time.monotonic() - _told_s > TELL_S:
        print(f"{what} {number} of {of}", flush=True)
        _told_s = time.monotonic()


def on_config(config):
    """Equations are fenced blocks of the kind "math". The site links to its repository."""
    config.repo_url = repository()
    config.repo_name = "Repository"
    config.mdx_configs["pymdownx.superfences"] = {
        "custom_fences": [{"name": "math", "class": "math", "format": equation}]
    }
    return config


def repository() -> str | None:
    """The page of the repository that this clone came from. A clone of a folder has none."""
    if not shutil.which("git"):
        return None
    found = subprocess.run(
        ["git", "-C", str(ROOT), "remote", "get-url", "origin"], capture_output=True, text=True
    )
    return web_address(found.stdout.strip())


def web_address(origin: str) -> str | None:
    """The page of a remote repository. The name and the password in its address stay out."""
    path = r"(?P<path>[^:]+?)(?:\.git)?/*"
    forms = (
        rf"(?:https?|ssh)://(?:[^@/]+@)?(?P<host>[\w.-]+)(?::\d+)?/{path}",
        rf"[^@/]+@(?P<host>[\w.-]+):{path}",
    )
    found = next((match for form in forms if (match := re.fullmatch(form, origin))), None)
    return found and f"https://{found['host']}/{found['path']}"


def on_files(files, config):
    from mkdocs.structure.files import File

    pages = {page: read_root(name) for page, name in FROM_ROOT.items()}
    pages["reference/commands.md"] = commands_page()
    pages["reference/python.md"] = python_page()
    pages["reference/parameters.md"] = parameters_page()
    pages["reference/channels.md"] = channels_page()
    pages |= {f"data/{path.stem}.md": data_page(path) for path in DATA.glob("*.csv")}
    gallery, pictures = gallery_page()
    pages["gallery.md"] = gallery
    pages["index.md"] = live_frame(pages["index.md"])
    for name, content in (pages | pictures).items():
        files.append(File.generated(config, name, content=content))
    files.append(File.generated(config, LIVE, content=live_page()))
    return files


def on_page_markdown(markdown, page, config, files):
    """A link to data leads to its page. One to a file that is no page becomes that file's path."""
    folder = os.path.dirname(page.file.src_uri)

    def without_code(link):
        text, target = link[1], link[2]
        if re.match(r"[a-z]+:|#", target):
            return link[0]
        path = os.path.normpath(os.path.join(folder, target.partition("#")[0]))
        shown = re.sub(r"\.csv$", ".md", path)
        if folder != "data" and shown != path and files.get_file_from_path(shown):
            return f"[{text}]({re.sub(r'.csv$', '.md', target)})"
        if files.get_file_from_path(path):
            return link[0]
        outside = os.path.normpath(os.path.join("docs", path))
        if not (ROOT / outside).exists():
            return link[0]  # MkDocs reports it
        return f"`{outside}`" if text.strip("`") in outside else f"{text} (`{outside}`)"

    _pages.add(page.file.src_uri)
    tell("page", len(_pages), len(files.documentation_pages()))
    parts = re.split(r"(^```.*?^```$)", markdown, flags=re.S | re.M)
    parts[::2] = [re.sub(r"(?<!!)\[([^\]]+)\]\(([^)\s]+)\)", without_code, p) for p in parts[::2]]
    parts[::2] = [re.sub(r"\$`([^`]+)`\$", in_line, p) for p in parts[::2]]
    return "".join(parts)


# --- equations --------------------------------------------------------------------


def mathml(source, display):
    """LaTeX, as GitHub draws it, as MathML."""
    from latex2mathml.converter import convert

    made = convert(source.strip(), display=display)
    unknown = re.search(r"<mi>(&|\\[a-z]+)</mi>", made)
    if unknown:
        raise ValueError(f"equation not understood at {unknown[1]}: {source}")
    # Browsers know the style, not the older attribute.
    return re.sub(r'columnalign="(\w+)"', r'style="text-align: \1"', made)


def equation(source, language, css_class, options, md, **kwargs):
    """A ```math block."""
    return f'<div class="math">{mathml(source, "block")}</div>'


def in_line(found):
    """$`…`$ in a line. Markdown takes a tag `math` at its beginning for a block."""
    return f"<span>{mathml(found[1], 'inline')}</span>"


# --- pages from files ---------------------------------------------------------------


def read_root(name: str) -> str:
    """A file of the root as a page of docs/: its links and pictures lead from there."""
    text = (ROOT / name).read_text()
    pages = {file: page for page, file in FROM_ROOT.items()}

    def moved(link):
        target = link[1]
        if re.match(r"[a-z]+:|#", target):
            return link[0]
        path, hash_, anchor = target.partition("#")
        path = pages.get(path) or os.path.relpath(path, "docs")
        return f"]({path}{hash_}{anchor})"

    return re.sub(r"\]\(([^)\s]+)\)", moved, text)


def data_page(path: Path) -> str:
    """A table of docs/data as a page: the pages that lead to it, the file, the table."""
    link = f"](data/{path.name})"
    told = [page for page in sorted(DATA.parent.glob("*.md")) if link in page.read_text()]
    names = [page.read_text().partition("\n")[0].removeprefix("# ") for page in told]
    where = ", ".join(f"[{name}](../{page.name})" for name, page in zip(names, told))
    with path.open() as file:
        head, *rows = csv.reader(file)
    return (
        f"# {path.stem}\n\nFrom {where}. The table as a file: [{path.name}]({path.name}).\n\n"
        + table(tuple(map(cell, head)), [tuple(row) for row in rows])
    )


# --- the drive in a browser -----------------------------------------------------------


def live_page() -> str:
    """The page of tools/web.py."""
    sys.path.insert(0, str(ROOT / "tools"))
    import web

    folder = ROOT / "build" / "web"
    return web.build(folder, web.SETUPS).read_text(encoding="utf-8")


def live_frame(home: str) -> str:
    """The home page with the drive after the first screen, which says what this is."""
    first, rest = home.split("\n## ", 1)
    frame = (
        f'<iframe class="live" src="{LIVE}" title="a drive that runs in this page" loading="lazy">'
        f'</iframe>\n<p><a href="{LIVE}">The drive on a page of its own</a></p>'
    )
    return f"{first}\n{frame}\n\n## {rest}"


# --- pages from the program ---------------------------------------------------------


def cell(text: object) -> str:
    """Text for a cell of a table."""
    return re.sub(r"\s+", " ", str(text)).replace("|", "\\|").replace("<", "&lt;")


def table(head: tuple[str, ...], rows: Sequence[tuple[object, ...]]) -> str:
    lines = [head, ("---",) * len(head), *(tuple(cell(c) for c in row) for row in rows)]
    return "\n".join("| " + " | ".join(line) + " |" for line in lines) + "\n"


def commands_page() -> str:
    text = ["# Commands", "Written from the program itself. `--help` shows the same.", ""]
    from hexatorque.cli.main import app

    for words, command in walk(app, ("hexatorque",)):
        text += command_section(words, command)
    return "\n".join(text)


def walk(command, words):
    """Every command that is no group and not hidden, with its words."""
    context = command.context_class(command, info_name=words[-1])
    if not hasattr(command, "list_commands"):
        yield words, command
        return
    for name in command.list_commands(context):
        inner = command.get_command(context, name)
        if inner is not None and not inner.hidden:
            yield from walk(inner, (*words, name))


def command_section(words: tuple[str, ...], command: click.Command) -> list[str]:
    context = command.context_class(command, info_name=" ".join(words))
    usage = " ".join([*words, *command.collect_usage_pieces(context)])
    text = [f"## {' '.join(words)}", "", inspect.cleandoc(command.help or ""), ""]
    text += ["```text", usage, "```", ""]
    rows = []
    for parameter in command.params:
        if getattr(parameter, "hidden", False) or "--help" in parameter.opts:
            continue
        if parameter.param_type_name == "argument":
            name = parameter.metavar or parameter.name.upper()
        else:
            value = "" if getattr(parameter, "is_flag", False) else parameter.metavar or "VALUE"
            name = f"{', '.join(parameter.opts)} {value}".strip()
        rows.append((f"`{name}`", getattr(parameter, "help", "") or ""))
    if rows:
        text += [table(("argument", "what"), rows), ""]
    if command.epilog:
        text += ["```text", inspect.cleandoc(command.epilog.replace("\b", "")), "```", ""]
    return text


def python_page() -> str:
    import hexatorque

    text = [
        "# Python",
        "",
        "The public names are at the top of the package: "
        + ", ".join(f"`hexatorque.{name}`" for name in hexatorque.__all__)
        + ". Scripts for a simulation and for a board are in [At the bench](../bench.md#a-script).",
        "",
    ]
    for room, names in PYTHON.items():
        module = importlib.import_module(f"hexatorque.{room}")
        text += [f"## hexatorque.{room}", ""]
        for name in names:
            home = getattr(module, name).__module__
            text += [f"::: {home}.{name}", ""]
    return "\n".join(text)


def parameters_page() -> str:
    from hexatorque import firmware

    text = (
        "# Parameters\n\nWritten from `firmware/app/ht_params.def`, the only place where a "
        "parameter is defined. A set-up gives them in its section `[controller]`, a board takes "
        "them from `hexatorque board set`. *Live*: may change while the drive runs.\n"
    )
    every = firmware.parameters()
    for title, names in firmware.grouped(every).items():
        rows = [
            (f"`{p.name}`", p.unit, f"{p.initial:g}", allowed(p), "yes" if p.live else "no", p.help)
            for p in map(every.__getitem__, names)
        ]
        head = ("name", "unit", "initial", "allowed", "live", "what")
        text += f"\n## {title}\n\n" + table(head, rows)
    return text


def allowed(parameter: Parameter) -> str:
    if parameter.choices:
        return ", ".join(f"`{choice}`" for choice in parameter.choices)
    return f"{parameter.min:g} to {parameter.max:g}"


def channels_page() -> str:
    from hexatorque import firmware

    about = defined("ht_channels.def", "HT_(?:CONTROL_)?CHANNEL")
    channels = [(f"`{name}`", unit, about[name][-1]) for name, unit in firmware.channels()]
    return (
        "# Channels, faults and states\n\n## Channels\n\nWhat the firmware measures or "
        "estimates, written from `firmware/app/ht_channels.def`. A simulation also records "
        "`plant.…`: the true values.\n\n"
        + table(("name", "unit", "what"), channels)
        + "".join(rows_of(word, what) for word, what in WORDS.items())
    )


#: Word of a table of the firmware, `ht_WORDs.def` -> what the page says of it.
WORDS = {
    "fault": "How each is found is in [Protection](../protection.md).",
    "warning": "Bits of the channel `warnings`.",
    "limit": "Bits of the channel `limits`: what keeps the torque from its reference.",
    "state": "The flags say whether the drive was started, its gates are on, and it controls.",
    "event": "What the log of a board keeps ([at the bench](../bench.md#what-a-board-remembers)).",
    "reset": "Why a board started.",
}


def rows_of(word: str, what: str) -> str:
    """A table of the firmware whose rows have a name, a number, a text and a word of help."""
    file = f"ht_{word}s.def"
    rows = [
        (row[2], f"`{row[1].rstrip('u')}`", in_words(row[3]))
        for row in defined(file, f"HT_{word.upper()}").values()
    ]
    return f"\n## {word.capitalize()}s\n\n{what} Written from `firmware/app/{file}`.\n\n" + table(
        (word, "number", "what"), rows
    )


def in_words(text: str) -> str:
    """A text of a row, flags such as HT_AT_WORK | HT_GATES_ON as words."""
    flags = re.fullmatch(r"0|HT_\w+(?: \| HT_\w+)*", text)
    names = [name.lower().replace("_", " ") for name in re.findall(r"HT_(\w+)", text)]
    return ", ".join(names) if flags else text


def defined(name: str, macro: str) -> dict[str, list[str]]:
    """The rows of a .def table by name: its fields, texts without their quotes."""
    source = (ROOT / "firmware" / "app" / name).read_text()
    rows = {}
    for line in re.findall(rf"^{macro}\((.*)\)$", source, re.M):
        fields = re.findall(r'\s*("[^"]*"|(?:[^,()"]|\([^()]*\))+)(?:,|$)', line)
        fields = [field.strip().strip('"') for field in fields]
        rows[fields[0]] = fields
    return rows


# --- the gallery --------------------------------------------------------------------


def sweeps() -> list[Path]:
    """The examples for `hexatorque sweep`: only their files say what varies."""
    return [p for p in sorted(EXAMPLES.glob("*.toml")) if "vary" in tomllib.loads(p.read_text())]


def scenarios() -> list[Path]:
    """The examples for `hexatorque run`."""
    return [p for p in sorted(EXAMPLES.glob("*.toml")) if p not in sweeps()]


def gallery_page() -> tuple[str, dict[str, bytes]]:
    text = [
        "# Gallery",
        "",
        "Everything here is in `examples/` and runs as it is. The notebooks are executed whenever "
        "this site is built, so their numbers and pictures are those of this version.",
        "",
    ]
    pictures: dict[str, bytes] = {}
    for path in sorted(EXAMPLES.glob("*.ipynb")):
        text += notebook(path, pictures)
    text += ["## Scenarios", "", "Run them with `hexatorque run examples/NAME.toml`.", ""]
    for path in scenarios():
        text += [f"### {path.name}", "", "```toml", path.read_text().strip(), "```", ""]
    text += ["## Sweeps", "", "Run them with `hexatorque sweep examples/NAME.toml`.", ""]
    for path in sweeps():
        text += [f"### {path.name}", "", "```toml", path.read_text().strip(), "```", ""]
    text += ["## Scripts", ""]
    for path in sorted(EXAMPLES.glob("*.py")):
        text += [f"### {path.name}", "", "```python", path.read_text().strip(), "```", ""]
    return "\n".join(text), pictures


def executed(path: Path) -> Any:
    """The notebook with its cells run; a cell that fails is an error."""
    import nbformat
    from nbclient import NotebookClient
    from traitlets.config import Config

    book = nbformat.read(path, as_version=4)
    local = Config({"ConnectionFileMixin": {"transport": "ipc"}})  # no port is opened
    client = NotebookClient(book, kernel_name="python3", timeout=300, config=local)
    client.on_cell_start = lambda cell, cell_index: tell(
        f"{path.name}: cell", cell_index + 1, len(book.cells)
    )
    client.execute()
    return book


def notebook(path: Path, pictures: dict[str, bytes]) -> list[str]:
    """An executed notebook as Markdown; its pictures are added to `pictures`."""
    book = executed(path)
    text: list[str] = []
    for cell_ in book.cells:
        if cell_.cell_type == "markdown":
            text += [re.sub(r"^#", "##", cell_.source, flags=re.M), ""]
            continue
        text += ["```python", cell_.source, "```", ""]
        for output in cell_.outputs:
            data = output.get("data", {})
            if "image/png" in data:
                name = f"images/gallery/{path.stem}-{len(pictures)}.png"
                pictures[name] = base64.b64decode(data["image/png"])
                text += [f"![A picture that the code above draws]({name})", ""]
            elif words := output.get("text") or data.get("text/plain"):
                text += ["```text", words.rstrip(), "```", ""]
    text += [f"This notebook is `examples/{path.name}`.", ""]
    return text
