"""The drive in a browser, one page in one file: `python tools/web.py [-o FOLDER] [SETUP ...]`.

The firmware, its register model and the plant become a module of WebAssembly (web/ht_web.c). The
page is the monitor's, with web/backend.js in the place of its way to a server. Beside drive.html
the folder has what it is made of, for tests: drive.wasm, setups.bin, tables.json.

All set-ups have machines of the same model: the plant is translated for one.
"""

from __future__ import annotations

import argparse
import base64
import gzip
import importlib.util
import json
import re
import struct
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from hexatorque import __version__, firmware, setups
from hexatorque.chips import EXACT, SOURCES
from hexatorque.drive.parts import SHORTEST_STEP_S
from hexatorque.drive.simulated import TIMED_WITH_THE_PLANT, SimulatedDrive
from hexatorque.errors import InputError
from hexatorque.firmware import ffi, lib
from hexatorque.monitor import described
from hexatorque.monitor.monitored_drive import CHANNELS
from hexatorque.monitor.traces import FRESH_S, HISTORY_S, HISTORY_VALUES, MEAN_S
from hexatorque.plant.breaks import breaks_of
from hexatorque.plant.legs import KINDS
from hexatorque.plant.load_kinds import LOADS
from hexatorque.plant.loop import MORE_CHANNELS, PLANT_CHANNELS
from hexatorque.plant.record import names_of
from hexatorque.plant.vsd import PHASES
from hexatorque.recording.recording import FORMAT
from hexatorque.results import RESULTS
from hexatorque.serial.wire import ChannelRow, FaultRow
from hexatorque.setups import SetupError, parameters
from hexatorque.to_c import plant

ROOT = Path(__file__).resolve().parents[1]
WEB = ROOT / "web"
PAGE = ROOT / "host" / "hexatorque" / "monitor" / "page"
#: Folders of the firmware that the module is made of, and what of the link it uses.
FOLDERS = ("core", "app", "port", "port/c2000", "port/host")
LINK = ("ht_burst.c", "ht_octets.c", "ht_packet.c", "ht_streams.c")
COMPILER = [sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi"]
#: The module is small rather than quick. Without the word inline, no function has copies.
SMALL = ["-Os", "-DHT_SMALL", "-Dinline=", "-mllvm", "-inline-threshold=0"]
OPTIONS = ["-mexec-model=reactor", *SMALL, *EXACT, "-s"]
#: The data begins where the stack ends. With a larger stack, all addresses in it move.
STACK_BYTES = 262_144
MOVED_BYTES = 4096
#: Modules that make the page, and the packages that have them.
NEEDED = {"ziglang": "ziglang", "zopfli": "zopfli", "minify": "tdewolff-minify"}
SCRIPT = "application/javascript"
#: Largest size of the page as a server sends it.
MOST_BYTES = 150_000
#: What the page of `make web` and of the site holds.
SETUPS = ("paper-b", "paper-a", "symmetrical")
#: Room for the name of a register (HT_REGFILE_LINE).
LINE = 64
#: What a row of the plant's true values has room for.
TRUE_VALUES = (*PLANT_CHANNELS, *MORE_CHANNELS)
#: Edges of a contact that opens, as many as ht_web.c has room for.
MOST_OPENS = 8


class Held:
    """A set-up as the page holds it."""

    def __init__(self, name: str) -> None:
        setup = setups.load(name)
        self.name, self.setup = setup.name, setup
        self.sim = SimulatedDrive(setup)

    @property
    def model(self) -> str:
        saturates = "saturable" in names_of(self.sim._machine.dtype)
        return f"{self.setup['machine.model']}{' with saturation' if saturates else ''}"

    def bytes(self) -> bytes:
        """`web_setup` of ht_web.c."""
        sim, setup = self.sim, self.setup
        records = [
            sim._machine, sim.inverter, sim.sensors, sim._timing, sim._map, sim._pwm, sim._gates
        ]  # fmt: skip
        opens = breaks_of("open", 0.0, 1e-3 * setup["inverter.bounce_ms"])
        more = MOST_OPENS - len(opens)
        table = firmware.parameters(setup["timing.device"])
        wanted = parameters(setup)
        params = [row.parse(wanted[name]) for name, row in table.items()]
        return b"".join(
            [
                *(record.tobytes() for record in records),
                np.asarray(sim.plant_state, np.float64).tobytes(),
                struct.pack(
                    "<2q7dq",
                    firmware.DEVICES.index(setup["timing.device"]),
                    LOADS.index(setup["load.kind"]),
                    setup["load.at_rpm"],
                    setup["machine.viscous_Nms"],
                    setup["machine.inertia_kgm2"],
                    sim._swing_per_s,
                    sim._windings_step_s,
                    SHORTEST_STEP_S,
                    setup["inverter.vdc_V"],
                    len(opens),
                ),
                struct.pack(f"<{MOST_OPENS}d", *(at_s for at_s, _ in opens), *[0.0] * more),
                struct.pack(
                    f"<{MOST_OPENS}q", *(KINDS.index(kind) for _, kind in opens), *[0] * more
                ),
                np.array(params, np.float64).tobytes(),
            ]
        )

    def described(self) -> dict:
        device = self.setup["timing.device"]
        every, here = firmware.parameters(), firmware.parameters(device)
        return {
            "name": self.name,
            "title": self.setup.title,
            "device": device,
            "plant": [
                f"plant.{name}" for name in [*dict(PLANT_CHANNELS), *self.sim._more_channels()]
            ],
            "ranges": {
                name: [row.min, row.max]
                for name, row in here.items()
                if (row.min, row.max) != (every[name].min, every[name].max)
            },
        }


def held(names: Sequence[str]) -> list[Held]:
    """The set-ups of these names or files. SetupError if the page cannot hold one."""
    found = [Held(name) for name in names]
    for one in found:
        kind = one.sim._machine.dtype
        if kind != found[0].sim._machine.dtype:
            raise SetupError(
                f"{one.name}: machine.model = {one.model}: the page holds machines of one model, "
                f"here {found[0].model}"
            )
        if len(breaks_of("open", 0.0, 1e-3 * one.setup["inverter.bounce_ms"])) > MOST_OPENS:
            raise SetupError(f"{one.name}: inverter.bounce_ms: too many edges of a contact")
    return found


def misfits() -> list[dict | None]:
    """By number: what two parameters have to do with each other."""
    rows: list[dict | None] = [None]
    for number in range(1, lib.HT_MISFITS):
        row = lib.ht_misfit_describe(number)
        of = {"first": row.first, "second": row.second}
        if row.share > 0:
            of |= {"share": firmware.decimal(row.share), "touch": bool(row.touch)}
        else:
            of["demand"] = ffi.string(lib.ht_misfit_demand(number)).decode()
        rows.append(of)
    return rows


def whole(value: Any) -> Any:
    """The same for JavaScript: 1 in place of 1.0, and what is false is left out."""
    if isinstance(value, dict):
        return {key: whole(one) for key, one in value.items() if one is not False}
    if isinstance(value, (list, tuple)):
        return [whole(one) for one in value]
    short = isinstance(value, float) and value.is_integer() and abs(value) < 1e6
    return int(value) if short else value


def tables(of: list[Held]) -> dict:
    """What the scripts need beside the module: the firmware's tables, texts, the set-ups."""
    described_channels = [lib.ht_channel_describe(k) for k in range(lib.ht_channel_count())]
    channels = [
        ChannelRow(*(ffi.string(t).decode() for t in (row.name, row.unit, row.help)))
        for row in described_channels
    ]
    rows = [lib.ht_fault_describe(k) for k in range(lib.ht_fault_count())]
    faults = [
        FaultRow(row.bit, ffi.string(row.name).decode(), ffi.string(row.help).decode())
        for row in rows
    ]
    device = described.tables(firmware.parameters(), channels, faults, list(firmware.STATES))
    for row in device["faults"]:
        del row["help"]  # the page shows names
    return {
        "version": __version__,
        "format": FORMAT,
        "device": device,
        "plant": [
            {"name": f"plant.{name}", "unit": unit, "help": "the plant's true value"}
            for name, unit in TRUE_VALUES
        ],
        "at_work": [state.at_work for state in firmware.STATE_TABLE],
        "idle": firmware.IDLE,
        "fault": firmware.FAULT,
        "results": {number: row.text for number, row in RESULTS.items()},
        "misfits": misfits(),
        "sets": firmware.PARAMETER_SETS,
        "events": firmware.EVENTS,
        "started": lib.HT_EVENT_START,
        "acting": list(firmware.LIMITS.values()),
        "resets": [firmware.reset_cause(number) for number in range(lib.HT_RESETS)],
        "timed": TIMED_WITH_THE_PLANT,
        "phases": PHASES,
        "traced": CHANNELS,
        "fresh_s": FRESH_S,
        "history_s": HISTORY_S,
        "history_values": HISTORY_VALUES,
        "mean_s": MEAN_S,
        "setups": [one.described() for one in of],
    }


def module(of: Held) -> bytes:
    """The module of WebAssembly for machines of this set-up's model."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place)
        for name, text in plant.translate(of.sim._machine.dtype).items():
            (folder / name).write_text(text, encoding="utf-8")
        code = [path for name in FOLDERS for path in sorted((SOURCES / name).glob("*.c"))]
        code += [SOURCES / "link" / name for name in LINK]
        code += [WEB / "ht_web.c", folder / plant.CODE]
        places = [*(SOURCES / name for name in (*FOLDERS, "link")), folder]
        output = folder / "drive.wasm"

        def linked(stack_bytes: int) -> bytes:
            command = [
                *COMPILER, *OPTIONS, f"-Wl,-z,stack-size={stack_bytes}",
                "-DHT_GATES_ACTIVE_LOW=0", f"-DWEB_PLANT_CHANNELS={len(TRUE_VALUES)}",
                *(f"-I{path}" for path in places),
                "-o", str(output), *map(str, code), "-lm",
            ]  # fmt: skip
            done = subprocess.run(command, capture_output=True, text=True)
            if done.returncode:
                raise InputError(f"zig failed:\n{done.stderr.strip()}")
            return output.read_bytes()

        return without_texts(linked(STACK_BYTES), linked(STACK_BYTES + MOVED_BYTES))


def texts_for_people() -> list[str]:
    """Texts in the module that nothing in it reads: names, helps, what registers are. The scripts
    have them from the tables. The choices of a parameter are read."""
    files = [p for f in FOLDERS for p in (SOURCES / f).iterdir() if p.suffix in (".c", ".def")]
    code = "\n".join(path.read_text(encoding="utf-8") for path in sorted(files))
    literals = [m[0] for m in re.finditer(r'(?:"[^"\n]*"\s*)+', code)]
    found = {"".join(re.findall(r'"([^"]*)"', literal)) for literal in literals}
    found |= {*firmware.parameters(), *(name for name, _ in firmware.channels())}
    for device in firmware.DEVICES:
        chip = ffi.new("ht_regfile *")
        lib.ht_regfile_reset(chip, firmware.board_of(device).map)
        line = ffi.new("char[]", LINE)
        for number in range(chip.bound_count):
            lib.ht_regfile_name(chip, lib.ht_regfile_address(chip, number), line)
            found |= set(ffi.string(line).decode().split("."))
    return sorted(text for text in found if len(text) > 3 and "|" not in text)


def without_texts(wasm: bytes, moved: bytes) -> bytes:
    """The module with zeros in their places, and one address for all of them: packed, it is a sixth
    smaller. moved: the same module with its data MOVED_BYTES further on. A word of the data is an
    address if it has moved, too."""
    base, begin, end = data_of(wasm)
    other = moved[data_of(moved)[1] :]
    data = wasm[begin:end]
    gone = set()
    for text in texts_for_people():
        whole = b"\0" + text.encode() + b"\0"
        gone |= {base + match.start() + 1 for match in re.finditer(re.escape(whole), data)}
        data = data.replace(whole, bytes(len(whole)))
    words = np.frombuffer(data[: len(data) & ~3], "<u4").copy()
    old, new = (np.frombuffer(of, "<u4", len(words)) for of in (wasm[begin:end], other))
    words[(new - old == MOVED_BYTES) & np.isin(old, list(gone))] = min(gone)
    return wasm[:begin] + words.tobytes() + data[4 * len(words) :] + wasm[end:]


def data_of(wasm: bytes) -> tuple[int, int, int]:
    """Address of the module's one segment of data, and its begin and end in the file."""

    def number(at: int) -> tuple[int, int]:
        value = shift = 0
        while True:
            value |= (wasm[at] & 0x7F) << shift
            shift += 7
            at += 1
            if wasm[at - 1] < 0x80:
                return value, at

    at = 8
    while wasm[at] != 11:  # the number of the section of data
        size, at = number(at + 1)
        at += size
    _, at = number(at + 1)
    if wasm[at : at + 3] != b"\x01\x00\x41":  # one segment; its address is a constant
        raise ValueError("the module has not one segment of data")
    address, at = number(at + 3)
    size, at = number(at + 1)
    return address, at, at + size


# --- one script of many --------------------------------------------------------------------


def bundle(entry: Path, replaced: Mapping[str, Path | str]) -> str:
    """A script and all that it imports as one that imports nothing, which runs from the disk, too.
    replaced: name of a module -> the file or text that stands in its place."""
    made: list[str] = []
    seen: set[str] = set()

    def add(path: Path) -> None:
        if path.name in seen:
            return
        seen.add(path.name)
        source = replaced.get(path.name, path)
        text = source if isinstance(source, str) else source.read_text(encoding="utf-8")
        folder = source.parent if isinstance(source, Path) else path.parent

        def imported(match: re.Match) -> str:
            name = match[2]
            add(next((p for p in (folder / name, PAGE / name) if p.exists()), folder / name))
            return f"const {{{match[1].replace(' as ', ': ')}}} = {_module(name)};"

        text = re.sub(r'^import \{([^}]*)\} from "\./([\w.]+)";$', imported, text, flags=re.M)
        given = re.findall(r"^export (?:async )?(?:const|class|function) ([\w$]+)", text, re.M)
        text = re.sub(r"^export ", "", text, flags=re.M)
        if left := re.search(r"^(import|export)\b.*", text, re.M):
            raise ValueError(f"{path.name}: the bundle does not know {left[0]!r}")
        made.append(
            f"const {_module(path.name)} = (() => {{\n{text}\n"
            f"return {{ {', '.join(given)} }};\n}})();"
        )

    add(entry)
    return "\n".join(["'use strict';", *made])


def _module(name: str) -> str:
    return "m_" + re.sub(r"\W", "_", name.removesuffix(".js"))


def page(wasm: bytes, blobs: list[bytes], texts: dict) -> str:
    """The page with all that it needs. Its scripts are packed with the module, because zopfli packs
    them smaller than a server does."""
    from minify import string as shorter
    from zopfli import gzip as denser  # the browser unpacks no other format, zlib packs 4 % worse

    held_parts: dict[str, bytes] = {}
    scripts: list[str] = []

    def inlined(match: re.Match) -> str:
        text = (PAGE / match[1]).read_text(encoding="utf-8")
        return f"<style>{shorter('text/css', text)}</style>"

    def packed(match: re.Match) -> str:
        path = PAGE / match[1]
        held_parts[path.name] = path.read_bytes()
        scripts.append(path.name)
        return ""

    html = (PAGE / "index.html").read_text(encoding="utf-8")
    html = re.sub(r'<link rel="stylesheet" href="([^"]+)">', inlined, html)
    html = re.sub(r'<script defer src="([^"]+)"></script>\n', packed, html)
    html = re.sub(r'<script type="module" src="monitor\.js"></script>\n', "", html)
    icon = (
        "data:image/svg+xml;base64," + base64.b64encode((PAGE / "icon.svg").read_bytes()).decode()
    )
    html = html.replace('"icon.svg"', f'"{icon}"')

    def script(entry: Path, replaced: Mapping[str, Path | str] = {}) -> bytes:
        return shorter(SCRIPT, bundle(entry, replaced)).encode()

    rows = texts["device"]["parameters"]
    columns = {key: [row[key] for row in rows] for key in rows[0]}  # backend.js makes rows of them
    told = {**texts, "device": {**texts["device"], "parameters": columns}}
    instead = {name: WEB / name for name in ("backend.js", "commission.js")}
    held_parts |= {
        "monitor": script(PAGE / "monitor.js", instead),
        "worker": script(WEB / "worker.js"),
        "analyst": script(PAGE / "analyst.js"),
        "tables": json.dumps(whole(told), separators=(",", ":")).encode(),
        "wasm": wasm,
        "setups": b"".join(blobs),
    }
    data = {
        "sizes": {name: len(part) for name, part in held_parts.items()},
        "scripts": [*scripts, "monitor"],
        "packed": base64.b64encode(denser.compress(b"".join(held_parts.values()))).decode(),
    }
    given = f"export const data = {json.dumps(data, separators=(',', ':'))};"
    first = script(WEB / "unpack.js", {"data.js": given}).decode()
    return html.replace("</body>", f"<script>{first}</script>\n</body>")


def build(folder: Path, names: Sequence[str]) -> Path:
    """Write the page and its parts. InputError if it is not possible."""
    missing = [name for name in NEEDED if importlib.util.find_spec(name) is None]
    if missing:
        wanted = " ".join(NEEDED[name] for name in missing)
        raise InputError(f"web: missing here: pip install {wanted}, or make web")
    of = held(names)
    wasm = module(of[0])
    blobs = [one.bytes() for one in of]
    texts = tables(of)
    html = page(wasm, blobs, texts)
    size = len(gzip.compress(html.encode(), 9))
    if size > MOST_BYTES:
        raise InputError(f"web: {size} bytes packed, allowed are {MOST_BYTES}: give fewer set-ups")
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "drive.wasm").write_bytes(wasm)
    (folder / "setups.bin").write_bytes(b"".join(blobs))
    (folder / "tables.json").write_text(json.dumps(texts), encoding="utf-8")
    path = folder / "drive.html"
    path.write_text(html, encoding="utf-8")
    print(f"{path}: {len(of)} set-ups, {size / 1e3:.0f} kB packed")
    return path


def main(words: Sequence[str] | None = None) -> None:
    parser = argparse.ArgumentParser(description="the drive in a browser, as one page")
    parser.add_argument("-o", "--out", type=Path, default=ROOT / "build" / "web")
    parser.add_argument("setup", nargs="*", default=SETUPS, help="names or files of set-ups")
    given = parser.parse_args(words)
    try:
        build(given.out, given.setup)
    except InputError as error:
        sys.exit(f"web: {error}".replace("web: web:", "web:"))


if __name__ == "__main__":
    main()
