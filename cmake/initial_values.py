"""Write the initial values of an image's parameters, from a set-up, as a C header.

Usage: initial_values.py SETUP DEVICE OUTPUT.h

SETUP is a built-in set-up's name or a file. DEVICE is the chip that the image is for, or empty.
Prints the files from which the values came. The package's own code computes the parameters from a
set-up (setups/to_parameters.py). That code needs only Python 3.11, so neither the installed package
nor a compiler for this computer is needed. The checks here are coarser than in a simulation, where
the firmware checks whether its parameters fit together.
"""

import re
import struct
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
#: The folder of the package: in the repository, or above the sources that are installed with it.
PACKAGE = next(
    folder for folder in (ROOT / "host", *ROOT.parents) if (folder / "hexatorque/setups").is_dir()
)
sys.path.insert(0, str(PACKAGE))
from hexatorque.given import choice, listed, numeric, suggest  # noqa: E402
from hexatorque.setups import loading, to_parameters  # noqa: E402
from hexatorque.setups.derived import DEFAULTS  # noqa: E402
from hexatorque.setups.keys import KEYS, SECTIONS, missing  # noqa: E402
from hexatorque.setups.setup import Setup, inconsistent  # noqa: E402
from hexatorque.setups.values import SetupError, Value  # noqa: E402

CORE, APP = ROOT / "firmware" / "core", ROOT / "firmware" / "app"
#: A row of a .def file: its kind and its arguments, which may be strings.
ROW = re.compile(r'^(HT_\w+)\(((?:"[^"]*"|[^"\n])*)\)', re.M)
#: How many numbers a value of these kinds has.
COUNTS = {"phases": (6, "six"), "harmonics": (4, "four"), "pairs": (4, "four")}
ARGUMENT = re.compile(r'\s*((?:"[^"]*"|[^",])+)')


def rows(file: Path, kind: str | tuple[str, ...]) -> list[list[str]]:
    """The arguments of a .def file's rows of one kind or of several, as they are written there."""
    found = [(name, ARGUMENT.findall(text)) for name, text in ROW.findall(file.read_text())]
    return [[word.strip() for word in words] for name, words in found if name.startswith(kind)]


class Parameter:
    """A row of ht_params.def."""

    def __init__(self, words: list[str]) -> None:
        self.name, _, _, self.low, self.high, self.initial = words[:6]
        #: The names of its values; empty if the parameter has no choices.
        self.choices = _choices(words[7]) if len(words) == 9 else []

    def number(self, value: object) -> float:
        if self.choices:
            text = {True: "on", False: "off"}[value] if isinstance(value, bool) else str(value)
            if text not in self.choices:
                names = ", ".join(self.choices)
                raise SetupError(f"controller.{self.name} = {value!r}: choose one of {names}")
            return float(self.choices.index(text))
        low, high = float(self.low.rstrip("f")), float(self.high.rstrip("f"))
        return checked(f"controller.{self.name}", value, low, high)


def _choices(word: str) -> list[str]:
    if word == "SCHEME_CHOICES":  # the schemes are in their own table
        return [words[1].strip('"') for words in rows(CORE / "ht_schemes.def", "HT_SCHEME")]
    return [name for name in word.strip('"').split("|") if name]


def checked(path: str, value: object, low: float, high: float) -> float:
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise SetupError(f"{path} = {value!r}: a number is needed")
    if not low <= value <= high:
        raise SetupError(f"{path} = {value:.9g}: allowed range is {low:.9g} .. {high:.9g}")
    return value


def bare(path: str, raw: object, known: dict) -> object:
    """A value without its tag and note."""
    section, key = path.split(".", 1)
    if key not in known:
        raise SetupError(f"unknown key {path}{suggest(key, known)}")
    value = raw.get("value") if isinstance(raw, dict) else raw
    spec = known[key]
    if section != "controller" and spec.kind == "file":  # of the plant alone
        if not isinstance(value, str):
            raise SetupError(f"{path} = {value!r}: the name of a file is needed")
        return value
    value = choice(value, spec.choices) if spec.choices else numeric(value)
    if section == "controller":
        return value
    if spec.kind == "choice":
        value = str(value)
        if value not in spec.choices:
            raise SetupError(f"{path} = {value!r}: choose one of {', '.join(spec.choices)}")
    elif spec.kind in COUNTS:
        count, word = COUNTS[spec.kind]
        several = listed(value) if isinstance(value, str) else value
        if not isinstance(several, list) or len(several) != count:
            raise SetupError(f"{path} = {value!r}: {word} numbers are needed")
        return tuple(checked(path, numeric(number), spec.min, spec.max) for number in several)
    else:
        value = checked(path, value, spec.min, spec.max)
        return int(value) if spec.kind == "integer" else float(value)
    return value


def values_of(source: str, table: dict, files: list[Path], depth: int = 0) -> tuple[dict, str]:
    """The values of a set-up and of those it starts from, and its word `defaults`. `files` gets
    what was read."""
    if depth > 20:
        raise SetupError(f"setup = {source!r}: the files refer to each other")
    path = Path(source)
    if not path.suffix and not path.exists():
        # CMake makes a path of a built-in name.
        name = path.name
        if name not in loading.builtin_names():
            raise SetupError(f"no set-up {name!r}{suggest(name, loading.builtin_names())}")
        text = loading.builtin_text(name)
        files.append(PACKAGE / "hexatorque/setups/builtin" / f"{name}.toml")
    else:
        text = loading.text_of(path)
        files.append(path.resolve())
    data = loading.toml_of(text)
    values: dict = {section: {} for section in SECTIONS}
    defaults = DEFAULTS[0]
    if "setup" in data:
        values, defaults = values_of(str(data["setup"]), table, files, depth + 1)
    for section in SECTIONS:
        known = table if section == "controller" else KEYS[section]
        entries = data.get(section, {})
        if not isinstance(entries, dict):
            raise SetupError(f"{section}: a table is needed")
        for key, raw in entries.items():
            values[section][key] = Value(bare(f"{section}.{key}", raw, known), "")
    defaults = choice(data.get("defaults", defaults), DEFAULTS)
    if defaults not in DEFAULTS:
        raise SetupError(f"defaults = {defaults!r}: choose one of {', '.join(DEFAULTS)}")
    return values, defaults


def initial_values(source: str, device: str, files: list[Path]) -> dict[str, str]:
    """Every parameter's initial value, as C."""
    lines = rows(APP / "ht_params.def", ("HT_PARAM", "HT_WHOLE"))
    table = {row.name: row for row in map(Parameter, lines)}
    values, defaults = values_of(source, table, files)
    setup = Setup(source, source, values, defaults=defaults)
    if lines := missing(setup.values, setup["machine.model"]) or inconsistent(setup):
        raise SetupError(lines[0])
    for_device = setup["timing.device"]
    if device and for_device != device:
        raise SetupError(f"timing.device = {for_device}: the image is for a {device}")
    given = setup.values["controller"]
    for key in given:
        table[key].number(given[key].value)
    # No rule uses the default of the scheme, which is not a plain number in the table.
    numbers = {n: float(row.initial.rstrip("f")) for n, row in table.items() if n != "scheme"}
    initial = {
        name: table[name].choices[int(number)] if table[name].choices else number
        for name, number in numbers.items()
    }
    decided = to_parameters.decided(setup, initial)
    return {
        name: as_float32(row.number(decided[name])) if name in decided else row.initial
        for name, row in table.items()
    }


def as_float32(value: float) -> str:
    """The same float32 number that the simulation passes to the firmware, to the last bit."""
    (rounded,) = struct.unpack("<f", struct.pack("<f", value))
    text = f"{rounded:.9g}"
    return f"{text}f" if set(text) & set(".e") else f"{text}.0f"


def main() -> int:
    source, device, output = sys.argv[1:]
    files: list[Path] = []
    try:
        values = initial_values(source, device, files)
    except SetupError as error:
        print(f"{source}: {error}", file=sys.stderr)
        return 1
    lines = [f"#define HT_INITIAL_{name} ({value})" for name, value in values.items()]
    head = f"/* Written by cmake/initial_values.py from {Path(source).name}. */"
    Path(output).write_text("\n".join([head, *lines]) + "\n")
    print("\n".join(path.as_posix() for path in files))
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
