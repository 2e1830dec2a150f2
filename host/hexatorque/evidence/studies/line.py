"""The serial link on a line that loses, flips, doubles, inserts and swaps bytes, each at 1e-3 per
byte. The study asks: is a wrong sample ever accepted? Is every missing sample counted? Do requests
get through? How many damaged frames does a CRC of a given number of bits accept?

Samples and replies come from the firmware itself on its register model, with a running drive. This
module does the damage. The receiver is the host's.
"""

from __future__ import annotations

import binascii
import struct
import zlib
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TypedDict

import numpy as np
from cobs import cobs

from ... import firmware, setups
from ...boards.virtual import BoardController, VirtualBoard
from ...experiments.operating_points import Progress
from ...firmware import lib
from ...serial import wire
from ...serial.sharing import REPLY_S, TRIES
from ...serial.wire import Op, Status
from .grids import Grid

TITLE = "Serial link on a line that damages its bytes"
SETUP = "paper-a-feasible"
KINDS = ("lost", "flipped", "doubled", "inserted", "swapped")
#: Rates of each kind of damage per byte: the one above, and one at which hardly any frame arrives.
RATE, HEAVY = 1e-3, 3e-2
BAUD = 3_000_000  #: enough for a sample of CHANNELS in every fast interrupt
CHANNELS = ("i_u1_A", "psi_alpha_Wb", "torque_Nm", "speed_rpm")
FRAMES, QUICK_FRAMES = 1_050_000, 20_000
CHECKED, QUICK_CHECKED = 3_000_000, 60_000
REQUESTS, QUICK_REQUESTS = 5_000, 250
#: Numbers of bits of the CRC-32 that are checked. The fewer, the more damaged frames pass.
BITS = (2, 4, 6, 8, 10, 12, 14, 16, 32)
NONCE = 0x2B2B
#: Simulated seconds between two transfers from the board's line.
PIECE_S = 0.05


def damage_bytes(raw: np.ndarray, rate: float, rng: np.random.Generator) -> np.ndarray:
    """The bytes (uint8) as they arrive. Each kind of damage has `rate` per byte."""
    n = len(raw)
    out = raw.copy()
    flipped = np.flatnonzero(rng.random(n) < rate)
    out[flipped] ^= (1 << rng.integers(0, 8, len(flipped))).astype(np.uint8)
    swapped = np.flatnonzero(rng.random(max(0, n - 1)) < rate)
    swapped = swapped[np.diff(swapped, prepend=-2) > 1]  # no byte in two swaps
    out[swapped], out[swapped + 1] = out[swapped + 1], out[swapped]
    times = np.ones(n, np.int64)
    times[rng.random(n) < rate] = 0
    times[rng.random(n) < rate] += 1
    inserted = rng.random(n) < rate
    arrived = np.repeat(out, times + inserted)
    at = np.cumsum(times + inserted)[inserted] - 1
    arrived[at] = rng.integers(0, 256, len(at))
    return arrived


def _as_array(data: bytes) -> np.ndarray:
    return np.frombuffer(data, np.uint8)


# --- samples --------------------------------------------------------------------------------


class _Source:
    """A drive that runs at changing speed and sends samples."""

    def __init__(self) -> None:
        setup = setups.load(SETUP).changed(
            timing__device="f28377s", controller__build_s=0.05, controller__build_current_A=20.0
        )
        self.board = VirtualBoard(setup, baud=BAUD)
        controller = self.board.controller
        assert isinstance(controller, BoardController)
        self.controller = controller
        self.dictionary = controller.board.service.dictionary & 0xFFFF
        self._id = 0
        self._turn = 0
        self._ask(Op.OPEN, wire.open_session(NONCE, 1))
        ids = [[name for name, _ in firmware.channels()].index(c) for c in CHANNELS]
        self._ask(Op.STREAM, wire.stream(0, tuple(ids), 1))
        self._ask(Op.START)

    def _ask(self, op: Op, payload: bytes = b"") -> None:
        self._id = (self._id + 1) & 0xFF
        body = wire.request(op, self._id, NONCE, self.dictionary, payload)
        self.controller.put(wire.frame(body))
        self.board.run(2e-3)

    def piece(self) -> bytes:
        """The bytes that the board sends in the next PIECE_S."""
        if self._turn % 20 == 10:
            self.controller.set("speed_ref_rpm", 400.0 * np.sin(self._turn / 60))
        self._ask(Op.STATUS)
        self._turn += 1
        self.board.run(PIECE_S - 2e-3)
        return self.controller.take()

    def healthy(self) -> bool:
        """Whether the drive ran to the end and the board itself dropped nothing."""
        c = self.controller
        return c.state == firmware.RUN and not c.board.service.streams.dropped


def _is_sample(body: bytes) -> bool:
    return body[0] == wire.SAMPLE and len(body) == 6 + 4 * len(CHANNELS)


def _tick(body: bytes) -> int:
    return struct.unpack_from("<I", body, 2)[0]


def _runs(missing: np.ndarray) -> int:
    """Number of runs of True."""
    return int(np.count_nonzero(np.diff(missing.astype(np.int8), prepend=0) == 1))


def _samples(frames: int, rng: np.random.Generator, progress: Progress | None) -> dict:
    source, clean, line = _Source(), wire.Splitter(), wire.Splitter()
    sent: dict[int, bytes] = {}  # samples of the latest piece, by tick
    older: dict[int, bytes] = {}  # those of the piece before
    sent_ticks: list[int] = []
    accepted: list[int] = []
    seen, wrong, sent_bytes = [], 0, 0
    while len(sent_ticks) < frames:
        data = source.piece()
        sent_bytes += len(data)
        older = sent
        sent = {_tick(b): b for b in clean.push(data) if _is_sample(b)}
        sent_ticks += sent
        seen += list(sent.values())[:20]
        for body in line.push(damage_bytes(_as_array(data), RATE, rng).tobytes()):
            if body[0] == wire.SAMPLE:
                tick = _tick(body)
                wrong += body != sent.get(tick, older.get(tick))
                accepted.append(tick)
        if progress:
            progress(PIECE_S)
    every, got = np.array(sent_ticks), np.array(accepted)
    inside = every[(every >= got[0]) & (every <= got[-1])]
    missing = ~np.isin(inside, got)
    steps = np.diff(got)
    return {
        "healthy": source.healthy() and bool((np.diff(every) == 1).all()),
        "bytes": sent_bytes,
        "sent": len(inside),
        "accepted": len(got),
        "wrong": int(wrong),
        "lost": int(missing.sum()),
        "gaps": _runs(missing),
        "lost_by_tick": int((steps - 1).sum()),
        "gaps_by_tick": int(np.count_nonzero(steps != 1)),
        "in_order": bool((steps > 0).all()),
        "damaged_frames": line.damaged,
        "longest_gap": int(steps.max()) - 1,
        "bodies": seen,
    }


# --- checks ---------------------------------------------------------------------------------


def _with_crc16(body: bytes) -> bytes:
    return body + struct.pack(">H", binascii.crc_hqx(body, 0xFFFF))


def _with_crc32(body: bytes) -> bytes:
    return body + struct.pack("<I", zlib.crc32(body))


def _damaged(
    bodies: list[bytes],
    close: Callable[[bytes], bytes],
    rate: float,
    frames: int,
    rng: np.random.Generator,
) -> Iterator[bytes]:
    """The damaged frames: bytes between two zeros that differ from every frame that was sent."""
    closed = [cobs.encode(close(body)) for body in bodies]
    good = set(closed)
    piece = _as_array(b"\0".join(closed) + b"\0")
    for _ in range(-(-frames // len(bodies))):
        for raw in damage_bytes(piece, rate, rng).tobytes().split(b"\0"):
            if raw and raw not in good:
                yield raw


def _decoded(raw: bytes) -> bytes | None:
    try:
        return cobs.decode(raw)
    except cobs.DecodeError:
        return None


def _checks(bodies: list[bytes], frames: int, rng: np.random.Generator) -> list[dict]:
    """Counts for each rate: the damaged frames, how many of them are valid COBS, how many pass a
    CRC-16, and how many agree with given numbers of bits of the CRC-32."""
    rows = []
    for rate in (RATE, HEAVY):
        length = len(bodies[0])
        damaged, exact, passed, passed_length = 0, 0, 0, 0
        for raw in _damaged(bodies, _with_crc16, rate, frames, rng):
            damaged += 1
            checked = _decoded(raw)
            if checked is None or len(checked) < 4:
                continue
            exact += 1
            if binascii.crc_hqx(checked, 0xFFFF) == 0:
                passed += 1
                passed_length += len(checked) == length + 2
        agree: Counter[int] = Counter()
        damaged32, exact32 = 0, 0
        for raw in _damaged(bodies, _with_crc32, rate, frames, rng):
            damaged32 += 1
            checked = _decoded(raw)
            if checked is None or len(checked) < 6:
                continue
            exact32 += 1
            differ = zlib.crc32(checked) ^ wire.CRC_RESIDUE
            agree[(differ & -differ).bit_length() - 1 if differ else 32] += 1
        bits = [[k, sum(n for low, n in agree.items() if low >= k)] for k in BITS]
        rows.append(
            {
                "rate": rate,
                "frames": frames,
                "damaged": damaged,
                "cobs": exact,
                "crc16": passed,
                "crc16_and_length": passed_length,
                "damaged32": damaged32,
                "cobs32": exact32,
                "bits": bits,
            }
        )
    return rows


# --- requests -------------------------------------------------------------------------------


class _Host:
    """A client that repeats its requests, in the board's time. Both directions are damaged."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.board = BoardController("f28377s", {}, None, lib.HT_SERVICE_WATCHDOG_MS)
        self.service = self.board.board.service
        self.dictionary = self.service.dictionary & 0xFFFF
        self.bytes_per_tick = self.service.setup.line.octets_per_s / 1e4
        self._rng = rng
        self._splitter = wire.Splitter()
        self._id = 0

    def ask(self, op: Op, payload: bytes) -> tuple[wire.Reply | None, int]:
        """The reply or None, and the number of tries."""
        self._id = (self._id + 1) & 0xFF
        frame = wire.frame(wire.request(op, self._id, NONCE, self.dictionary, payload))
        patience = round(1e4 * REPLY_S + (len(frame) + wire.LONGEST_FRAME) / self.bytes_per_tick)
        for tried in range(1, TRIES + 1):
            self.board.put(damage_bytes(_as_array(frame), RATE, self._rng).tobytes())
            for _ in range(patience):
                lib.ht_virtual_fast(self.board.board)
                came = self.board.take()
                if not came:
                    continue
                for body in self._splitter.push(
                    damage_bytes(_as_array(came), RATE, self._rng).tobytes()
                ):
                    reply = wire.parse_reply(body)
                    if (reply.op, reply.id) == (op, self._id):
                        return reply, tried
        return None, TRIES


class _Requests(TypedDict):
    """The results of one kind of request."""

    request: str
    tries: list[int]  #: the numbers answered at the first try, at the second, ...
    failed: int
    wrong: int


def _requests(count: int, rng: np.random.Generator) -> list[_Requests]:
    host = _Host(rng)
    drive = host.board.drive
    ids = tuple(range(20))
    rows: list[_Requests] = []
    for op in (Op.STATUS, Op.GET, Op.WRITE, Op.ARM, Op.HELLO):
        rows.append({"request": op.name, "tries": [0] * TRIES, "failed": 0, "wrong": 0})
    for n in range(count):
        if n % 50 == 0:  # the session may have ended in the meantime
            while not host.ask(Op.OPEN, wire.open_session(NONCE, 1))[0]:
                pass
        row = rows[n % len(rows)]
        op = Op[row["request"]]
        value = float(n % 1000) / 8
        payload = {
            Op.GET: struct.pack("<20H", *ids),
            Op.WRITE: struct.pack("<HfHf", 9, value, 10, -value),
            Op.ARM: struct.pack("<BBHIIHf2H", 2, 0, 1, 50, 25, 0, 0.0, 1, 2),
        }.get(op, b"")
        before = host.service.burst.number
        reply, tried = host.ask(op, payload)
        after = host.service.burst.number
        if reply is None:
            row["failed"] += 1
            steps = (0, 1) if op is Op.ARM else (0,)
        else:
            row["tries"][tried - 1] += 1
            steps = (1,) if op is Op.ARM else (0,)
        # A request is carried out once, however often it was repeated.
        good = (after - before) & 0xFF in steps
        if reply is not None:
            good &= reply.status == Status.DONE
            if op is Op.GET:
                values = struct.pack("<20f", *(lib.ht_drive_get(drive, k) for k in ids))
                good &= reply.payload == values
            elif op is Op.WRITE:
                good &= (lib.ht_drive_get(drive, 9), lib.ht_drive_get(drive, 10)) == (value, -value)
            elif op is Op.ARM:
                good &= reply.payload == bytes([after])
        row["wrong"] += not good
    return rows


# --- the study ------------------------------------------------------------------------------


def study(quick: bool = False, progress: Progress | None = None) -> dict:
    rng = np.random.default_rng(20240229)
    samples = _samples(QUICK_FRAMES if quick else FRAMES, rng, progress)
    bodies = samples.pop("bodies")
    checks = _checks(bodies[:2000], QUICK_CHECKED if quick else CHECKED, rng)
    requests = _requests(QUICK_REQUESTS if quick else REQUESTS, rng)
    return {"rate": RATE, "samples": samples, "checks": checks, "requests": requests}


def failures(result: dict) -> list[str]:
    s = result["samples"]
    found = []
    if not s["healthy"]:
        found.append("the drive stopped, or the board itself dropped samples")
    if s["wrong"]:
        found.append(f"{s['wrong']} wrong samples were accepted")
    if not s["in_order"]:
        found.append("samples came out of order")
    if (s["lost"], s["gaps"]) != (s["lost_by_tick"], s["gaps_by_tick"]):
        found.append(
            f"{s['lost']} samples in {s['gaps']} gaps were lost, ticks say {s['lost_by_tick']} "
            f"in {s['gaps_by_tick']}"
        )
    for row in result["checks"]:
        if dict(map(tuple, row["bits"]))[32]:
            found.append("a damaged frame passed the CRC-32")
    for row in result["requests"]:
        if row["wrong"]:
            found.append(f"{row['wrong']} {row['request']} requests had a wrong effect")
    return found


#: What the table of the samples says, and the result's key.
COUNTED = {
    "sent": "sent",
    "accepted": "accepted",
    "accepted and wrong": "wrong",
    "lost": "lost",
    "lost, by the ticks": "lost_by_tick",
    "gaps": "gaps",
    "gaps, by the ticks": "gaps_by_tick",
    "longest gap": "longest_gap",
    "damaged frames that the receiver counted": "damaged_frames",
}


def grid(result: dict) -> Grid:
    samples = [[name, f"{result['samples'][key]:,}"] for name, key in COUNTED.items()]
    requests = [
        [row["request"], *map(str, row["tries"]), str(row["failed"]), str(row["wrong"])]
        for row in result["requests"]
    ]
    tries = (f"try {k}" for k in range(1, TRIES + 1))
    return [
        (f"{', '.join(KINDS)}: {result['rate']:g} each per byte", ["samples", ""], samples),
        _passing(result),
        (
            "Requests, both directions damaged",
            ["request", *tries, "failed", "wrong"],
            requests,
        ),
    ]


def _passing(result: dict) -> tuple[str, list[str], list[list[str]]]:
    """How many damaged frames pass."""
    heads = ["per byte", "damaged", "exact COBS", "CRC-16", "and length", "one in"]
    heads += [f"{k} bits of CRC-32, one in" for k in (8, 16)]
    rows = []
    for row in result["checks"]:
        bits = dict(map(tuple, row["bits"]))
        passed = (
            (row["damaged"], row["crc16"]),
            (row["damaged32"], bits[8]),
            (row["damaged32"], bits[16]),
        )
        rows.append(
            [
                f"{row['rate']:g}",
                *(f"{row[key]:,}" for key in ("damaged", "cobs", "crc16", "crc16_and_length")),
                *(f"{n / through:,.0f}" if through else "–" for n, through in passed),
            ]
        )
    return "Damaged frames that pass", heads, rows


def plot(result: dict, path: Path) -> Path:
    """The share of the damaged frames that agree with a number of bits of the CRC."""
    from ...analysis import plots

    figure, axes = plots.new_figure(1, 1, 4.0, 6.5)
    axis = axes[0][0]
    colours = (plots.COLOUR["i_u1"], plots.COLOUR["torque"])
    for row, colour in zip(result["checks"], colours):
        seen = [(k, n / row["damaged32"]) for k, n in row["bits"] if n]
        label = f"{row['rate']:g} per byte and kind"
        axis.semilogy(*zip(*seen), "o", color=colour, label=f"{label}: bits of the CRC-32")
        if row["crc16"]:
            share = row["crc16"] / row["damaged"]
            axis.semilogy([16], [share], "x", ms=9, color=colour, label=f"{label}: CRC-16")
    bits = np.array([0, 20])
    axis.semilogy(bits, 2.0**-bits, lw=0.8, color="0.5", label="one in 2^bits")
    axis.set_xlabel("bits of the check", **plots.LABEL)
    axis.set_ylabel("share of the damaged frames", **plots.LABEL)
    axis.legend(**plots.LEGEND)
    figure.suptitle(f"{TITLE}: damaged frames that a check of so many bits accepts", **plots.TITLE)
    return plots.save(figure, path)
