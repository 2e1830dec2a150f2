"""Reads every name and value that a user gives: on the command line, in a file, on the web page or
in Python. Every other module asks this one, so all of them read alike."""

from __future__ import annotations

import codecs
import difflib
import re
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from .errors import InputError

#: A decimal number; point or comma is the decimal sign, and there are no thousands separators.
#: page/numbers.js has the same rule; both are tried with tests/host/numbers.json.
_NUMBER = re.compile(
    r"[+-]?(?:(?:\d+[.,]?\d*|[.,]\d+)(?:e[+-]?\d+)?|inf|infinity|nan)", re.ASCII | re.IGNORECASE
)
#: Minus signs that word processors write.
_MINUS = str.maketrans("−–", "--")


def real(text: str) -> float:
    """A number from text. ValueError for any other text."""
    plain = text.strip().translate(_MINUS)
    if not _NUMBER.fullmatch(plain):
        raise ValueError(text)
    return float(plain.replace(",", "."))


def number(text: str) -> float | int:
    """The same; digits alone are a whole number."""
    value = real(text)
    plain = text.strip().translate(_MINUS)
    return int(plain) if re.fullmatch(r"[+-]?\d+", plain, re.ASCII) else value


def numeric(value: Any) -> Any:
    """Text as the number that it is. All else stays as it is."""
    if isinstance(value, str):
        try:
            return number(value)
        except ValueError:
            return value
    return value


def plain(value: Any) -> Any:
    """numpy's numbers and arrays as Python's numbers and lists."""
    return value.tolist() if hasattr(value, "dtype") and hasattr(value, "tolist") else value


def choice(value: Any, choices: Iterable[str]) -> Any:
    """The choice of this name, in capital or small letters. All else stays as it is."""
    if not isinstance(value, str):
        return value
    word = value.strip().lower()
    return next((one for one in choices if one.lower() == word), value)


def parameter_name(name: str) -> str:
    """The name of a controller parameter that may be given as a set-up's key, controller.NAME."""
    return str(name).removeprefix("controller.")


def pairs(values: object) -> dict[Any, Any]:
    """Names or keys with their values. InputError for what is no dictionary of them."""
    if values is None:
        return {}
    if not isinstance(values, Mapping):
        example = "{'controller.rs_ohm': 2}"
        raise InputError(f"{values!r}: names with values are needed, such as {example}")
    return dict(values)


def several(values: Any, name: str) -> list[Any]:
    """A list, or a value that stands for a list of one. InputError for anything else."""
    if isinstance(values, (str, int)):
        return [values]
    try:
        return [plain(value) for value in values]
    except TypeError:
        raise InputError(f"{name} = {values!r}: a list is needed") from None


def listed(text: str) -> list[str]:
    """The parts of a list: between semicolons, or else blanks, or else commas. Brackets around the
    list are left out. With semicolons and blanks a comma is a decimal comma."""
    inner = text.strip().removeprefix("[").removesuffix("]").strip()
    if ";" in inner:
        parts = inner.split(";")
    else:
        parts = re.split(r",?\s+" if re.search(r"\s", inner) else ",", inner)
    return [part.strip() for part in parts if part.strip()]


def suggest(word: object, known: Iterable[str]) -> str:
    """The end of a line about an unknown word: the one that was meant, or all there are."""
    known = list(known)
    by_small = {name.lower(): name for name in reversed(known)}
    small = str(word).lower()
    close = difflib.get_close_matches(small, by_small, 1)
    close += [name for name in by_small if small and name.startswith(small)]
    return f"; did you mean {by_small[close[0]]!r}?" if close else f"; known: {', '.join(known)}"


def decode(raw: bytes) -> str:
    """The text of a file in UTF-8, UTF-16 or Windows' code page, with any ends of lines."""
    try:
        if raw.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            text = raw.decode("utf-16")
        elif raw[1:2] == b"\0":
            text = raw.decode("utf-16-le")
        elif raw[:1] == b"\0":
            text = raw.decode("utf-16-be")
        else:
            try:
                text = raw.decode("utf-8-sig")
            except UnicodeDecodeError:
                text = raw.decode("cp1252", errors="replace")
    except UnicodeDecodeError:
        raise InputError("the text ends within a character of UTF-16") from None
    return text.replace("\r\n", "\n").replace("\r", "\n") if "\r" in text else text


def text_of(path: Path) -> str:
    """The text of a file, whichever editor wrote it. InputError tells, without the file's name, why
    there is none."""
    try:
        text = decode(path.read_bytes())
    except FileNotFoundError as error:
        raise InputError(f"{error.strerror}{other_file(path)}") from None
    except OSError as error:
        raise InputError(error.strerror) from None
    except ValueError:  # a path with a null character
        text = "\0"
    if "\0" in text:
        raise InputError("not a text file")
    return text


def other_file(path: Path) -> str:
    """The end of a line about a file that is not there: the one beside it that was meant. The
    suffix, which they have in common, makes no name like another one."""
    try:
        stems = [other.stem for other in path.parent.iterdir() if other.suffix == path.suffix]
    except OSError:  # there is no such folder
        return ""
    close = difflib.get_close_matches(path.stem, stems, 1)
    return f"; did you mean {str(path.parent / (close[0] + path.suffix))!r}?" if close else ""
