"""ASAM MDF 4.10: one channel group with units, a board's `tick` among them; the header as the
attached file `recording.json`. Library: asammdf."""

from __future__ import annotations

import json
import logging
import os
import subprocess
import sys
import tempfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import BinaryIO

import numpy as np

from . import npz
from .formats import one_line
from .recording import Recording, from_header, header_text

ATTACHED = "recording.json"
#: Reading takes this long at most, and a second more for so many bytes.
LONGEST_S, SLOWEST_B_S = 60.0, 1e6
#: The metadata that other programs show among the file's properties.
SHOWN = ("hexatorque", "setup", "scheme", "device", "firmware", "gaps", "lost_samples")


@contextmanager
def _quiet() -> Iterator[None]:
    """Suppress the library's printed errors. It prints errors that it also raises, and objects
    that it could not complete raise again when they are deleted."""
    logger, hook = logging.getLogger("asammdf"), sys.unraisablehook
    before, logger.disabled = logger.disabled, True
    sys.unraisablehook = lambda _: None
    try:
        yield
    finally:
        logger.disabled, sys.unraisablehook = before, hook


def _crc32(rec: Recording) -> int:
    """The CRC of all samples. An .mf4 file has hardly any other protection."""
    crc = 0
    for data in rec.channels.values():
        crc = zlib.crc32(np.ascontiguousarray(data).view(np.uint8).data, crc)
    return crc


def save(rec: Recording, path: Path) -> None:
    from asammdf import MDF, Signal

    header = header_text(rec, crc32=_crc32(rec)).encode()
    time_s = rec.time_s
    signals = [
        Signal(
            samples=np.ascontiguousarray(data),
            timestamps=time_s,
            name=name,
            unit=rec.units.get(name, ""),
            comment="true value" if name.startswith("plant.") else "the controller's value",
        )
        for name, data in rec.channels.items()
    ]
    if signals and (ticks := rec.ticks) is not None:
        comment = "the board's count of fast interrupts"
        signals.append(Signal(samples=ticks, timestamps=time_s, name="tick", comment=comment))
    with _quiet(), MDF(version="4.10") as mdf:
        if signals:
            mdf.append(
                signals,
                acq_name="recording",
                comment=f"hexatorque, {rec.rate_Hz:.10g} samples/s",
                common_timebase=True,
            )
        mdf.attach(
            header,
            file_name=ATTACHED,
            comment="units, metadata, rate and start of the recording",
            mime="application/json",
        )
        shown = [f"{key}: {rec.meta[key]}" for key in SHOWN if key in rec.meta]
        mdf.header.comment = "\n".join(["hexatorque recording", *shown])
        # A recording without a start time always gets the same one.
        mdf.header.start_time = datetime.fromtimestamp(0, UTC)
        with suppress(KeyError, TypeError, ValueError):
            mdf.header.start_time = datetime.fromisoformat(rec.meta["started"]).astimezone(UTC)
        mdf.save(path, overwrite=True, compression=1)


def load(path: Path) -> Recording:
    """Read a file in a process of its own: the library's compiled code may crash or never end when
    a file is damaged."""
    longest_s = LONGEST_S + path.stat().st_size / SLOWEST_B_S
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "recording.npz"
        try:
            done = subprocess.run(
                [sys.executable, "-m", __name__, path, out],
                env={**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                text=True,
                timeout=longest_s,
            )
        except subprocess.TimeoutExpired:
            raise ValueError(f"asammdf does not come to an end within {longest_s:.0f} s") from None
        if done.returncode:
            said = done.stdout.splitlines() or ["asammdf crashes"]
            raise ValueError(said[-1])
        return npz.load(out)


def main() -> None:
    """In that process: the recording as .npz, or the reason why there is none."""
    path, out = map(Path, sys.argv[1:])
    try:
        npz.save(_read(path), out, compressed=False)
    except Exception as error:
        print(one_line(error), flush=True)
        os._exit(1)
    os._exit(0)  # objects of a damaged file may raise errors when they are deleted, or crash


def _read(path: Path) -> Recording:
    with path.open("rb") as file:
        header, channels = _contents(file)
    rec = from_header(header, channels)
    if json.loads(header)["crc32"] != _crc32(rec):
        raise ValueError("damaged samples")
    return rec


def _contents(file: BinaryIO) -> tuple[bytes, dict[str, np.ndarray]]:
    """The header and the samples."""
    from asammdf import MDF

    with MDF(file) as mdf:
        names = [str(block.file_name) for block in mdf.attachments]
        if ATTACHED not in names:
            raise ValueError("another program made it: export it there as .csv or .mat")
        header = bytes(mdf.extract_attachment(names.index(ATTACHED))[0])
        wanted = [
            (channel.name, group, index)
            for group, content in enumerate(mdf.groups)
            for index, channel in enumerate(content.channels)
            if index != mdf.masters_db.get(group)
        ]
        signals = mdf.select(wanted, raw=True) if wanted else []
    samples = {w[0]: signal.samples for w, signal in zip(wanted, signals, strict=True)}
    samples.pop("tick", None)
    return header, samples


if __name__ == "__main__":
    main()
