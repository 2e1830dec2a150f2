"""Puts several recordings of any origin into one picture: aligns them, draws them, and computes
their differences."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from ..firmware import causes
from ..given import real
from ..recording import mapping
from ..recording.recording import SPEED_REFERENCE, TRIGGER, Recording, RecordingError
from .panels import COLOURS, INK, LABEL, LEGEND, TITLE, new_figure, save, thin

if TYPE_CHECKING:
    from matplotlib.axes import Axes

ALIGNMENTS = ("trigger", "start", "none")
#: Channels that are shown if the user names none, as far as all recordings have them. If a measured
#: channel is missing, its true value (`plant.`) is shown.
MAIN = ("i_u1_A", "i_u2_A", "torque_Nm", "speed_rpm", "flux_Wb")
FLUX = "flux_Wb"  #: computed from psi_alpha_Wb and psi_beta_Wb if there is no such channel
MOST_BY_DEFAULT = 6
#: Channels whose reference is another one.
REFERENCES = {"torque_Nm": "torque_ref_Nm", FLUX: "flux_ref_Wb"}
#: Name of the lines that show them.
REFERENCE = "reference"
#: Most trips of a recording that are marked.
MOST_TRIPS = 5
ROW_IN, HEAD_IN = 1.55, 0.55
MOST_ROWS = 40
TRIP_COLOUR = "#b3261e"


@dataclass
class Trace:
    """One recording in an overlay. `shift_s` is subtracted from its time."""

    label: str
    rec: Recording
    shift_s: float = 0.0
    file: str = ""

    @property
    def time_s(self) -> np.ndarray:
        return self.rec.time_s - self.shift_s

    @property
    def begin_s(self) -> float:
        return self.rec.start_s - self.shift_s

    @property
    def end_s(self) -> float:
        return self.begin_s + self.rec.duration_s

    @property
    def title(self) -> str:
        """The title of the set-up or scenario that was recorded."""
        title = self.rec.meta.get("title")
        return title if isinstance(title, str) else ""

    def legend(self, with_title: bool = False) -> str:
        meta = self.rec.meta
        own = f": {self.title}" if with_title and self.title else ""
        parts = [f"{self.rec.rate_Hz:.6g}/s"]
        if self.shift_s:
            parts.append(f"shifted by {-self.shift_s:+.6g} s")
        if meta.get("lost_samples"):
            parts.append(f"{meta['lost_samples']} samples lost")
        if meta.get("closed") is False:
            parts.append("not closed")
        return f"{self.label}{own}  ({', '.join(parts)})"


def read(
    arguments: list[str], maps: Iterable[str] = (), shift_s: float | None = None
) -> list[Trace]:
    """Reads files. FILE@SECONDS sets the trigger of a recording, in seconds on its own time
    base. maps, shift_s: see `recording.mapping`."""
    traces = []
    for argument in arguments:
        file, at, seconds = argument.rpartition("@")
        trigger_s = None
        if at and not Path(argument).exists():
            try:
                trigger_s = real(seconds)
            except ValueError:
                trigger_s = math.nan
            if not math.isfinite(trigger_s):
                raise RecordingError(f"{argument}: after @ the time of the trigger in s is needed")
        else:
            file = argument
        rec = Recording.load(file)
        if not len(rec):
            raise RecordingError(f"{file}: no samples")
        if trigger_s is not None:
            rec.meta[TRIGGER] = trigger_s
        traces.append(Trace(file, rec, file=file))
    files, recs = [t.file for t in traces], [t.rec for t in traces]
    for trace, rec in zip(traces, mapping.mapped(files, recs, maps, shift_s), strict=True):
        trace.rec = rec
    _shorten(traces)
    return traces


def _shorten(traces: list[Trace]) -> None:
    """Shorten each label to the last parts of its path that distinguish the files."""
    paths = [Path(trace.label).parts for trace in traces]
    for trace, parts in zip(traces, paths):
        for n in range(1, len(parts) + 1):
            trace.label = "/".join(parts[-n:])
            if sum(other[-n:] == parts[-n:] for other in paths) == 1:
                break


def align(traces: list[Trace], how: str | None) -> str:
    """Sets the shifts and returns the alignment that was used. If `how` is None, recordings are
    aligned by the trigger if all have one. Otherwise several recordings are aligned by their
    start."""
    without = next((t for t in traces if t.rec.trigger_s is None), None)
    if how is None:
        how = "trigger" if not without else "start" if len(traces) > 1 else "none"
    if how == "trigger" and without:
        raise RecordingError(
            f"{without.label}: no trigger ({TRIGGER} in the metadata): give FILE@SECONDS, "
            "or --align start"
        )
    for trace in traces:
        own_s = {"trigger": trace.rec.trigger_s, "start": trace.rec.start_s, "none": 0.0}[how]
        assert own_s is not None  # if aligned by the trigger, all have one
        trace.shift_s = float(own_s)
    return how


def values(rec: Recording, name: str) -> np.ndarray | None:
    """The values of a channel, or of one that is computed from others. None if there is neither."""
    prefix, _, plain = name.rpartition(".")
    if name in rec:
        return rec[name]
    if plain != FLUX:
        return None
    dot = f"{prefix}." if prefix else ""
    alpha, beta = (rec.channels.get(f"{dot}psi_{axis}_Wb") for axis in ("alpha", "beta"))
    return None if alpha is None or beta is None else np.hypot(alpha, beta)


def reference(rec: Recording, name: str) -> np.ndarray | None:
    """The values that the channel should have; None if they are not known."""
    plain = name.rpartition(".")[2]
    if plain in REFERENCES:
        return values(rec, REFERENCES[plain])
    steps = rec.meta.get(SPEED_REFERENCE)
    if plain != "speed_rpm" or not steps:
        return None
    try:
        times_s, speeds_rpm = np.array(steps, float).reshape(len(steps), 2).T
    except (TypeError, ValueError):  # another program's
        return None
    latest = np.searchsorted(times_s, rec.time_s + 1e-6 / rec.rate_Hz, "right") - 1
    speed_rpm = np.where(latest < 0, np.nan, speeds_rpm[latest])
    controls = values(rec, REFERENCES[FLUX])  # NaN where the drive does not
    return speed_rpm if controls is None else np.where(np.isfinite(controls), speed_rpm, np.nan)


def trips(rec: Recording) -> list[tuple[float, str]]:
    """Time on the recording's own axis, and faults, of each trip in it."""
    if "faults" not in rec:
        return []
    bits = np.nan_to_num(np.asarray(rec["faults"], float)).astype(int)
    begun = np.flatnonzero((bits[1:] != 0) & (bits[:-1] == 0)) + 1
    return [(float(rec.time_s[n]), ", ".join(causes(int(bits[n])))) for n in begun[:MOST_TRIPS]]


def unit(traces: list[Trace], name: str) -> str:
    if name.rpartition(".")[2] == FLUX:
        return "Wb"
    return next((u for t in traces if (u := t.rec.units.get(name))), "")


def chosen(traces: list[Trace], names: list[str] | None) -> list[str]:
    """The channels that the user named; every recording must have them. If `names` is None, the
    main channels that every recording has."""

    def everywhere(name: str) -> bool:
        return all(values(trace.rec, name) is not None for trace in traces)

    if names is not None:
        for name in names:
            for trace in traces:
                if values(trace.rec, name) is None:
                    raise RecordingError(
                        f"{trace.label}: no channel {name!r}; there are "
                        f"{', '.join(trace.rec.channels)}"
                    )
        found = list(dict.fromkeys(names))
    else:
        both = ([n for n in (name, f"plant.{name}") if everywhere(n)][:1] for name in MAIN)
        found = [name for names in both for name in names]
        found = found or [n for n in traces[0].rec.channels if everywhere(n)][:MOST_BY_DEFAULT]
    if not found:
        raise RecordingError("the recordings have no channel in common")
    if len(found) > MOST_ROWS:
        raise RecordingError(f"{len(found)} channels: at most {MOST_ROWS} in a picture")
    return found


def cut(traces: list[Trace], window_s: tuple[float, float] | None) -> list[Trace]:
    """The part of each trace with window_s[0] <= time < window_s[1]."""
    if window_s is None:
        return traces
    parts = []
    for trace in traces:
        part = trace.rec.window(window_s[0] + trace.shift_s, window_s[1] + trace.shift_s)
        if not len(part):
            raise RecordingError(
                f"{trace.label}: no samples in the window; it lasts from {trace.begin_s:.6g} "
                f"to {trace.end_s:.6g} s"
            )
        parts.append(replace(trace, rec=part))
    return parts


def difference(first: Trace, other: Trace, name: str) -> tuple[float | None, int]:
    """The rms of other - first over the time that both cover, and the number of compared samples.
    The rms is None if no sample can be compared. The values of the faster recording are
    interpolated at the instants of the slower one. Lost samples are not compared.
    """
    slow, fast = sorted((first, other), key=lambda trace: trace.rec.rate_Hz)
    t_s, fast_s = slow.time_s, fast.time_s
    slack_s = 1e-6 / fast.rec.rate_Hz  # times that differ by rounding only are the same instant
    common = (t_s >= fast_s[0] - slack_s) & (t_s <= fast_s[-1] + slack_s)
    y_slow = np.asarray(values(slow.rec, name), float)[common]
    error = np.interp(t_s[common], fast_s, np.asarray(values(fast.rec, name), float)) - y_slow
    error = error[np.isfinite(error)]
    return (float(np.sqrt(np.mean(error**2))) if error.size else None), int(error.size)


def summary(traces: list[Trace], names: list[str], how: str) -> dict:
    """The data for --json: the files, and for each channel the rms difference of each file from the
    first, in the channel's unit. It is None for the first file."""
    channels = {}
    for name in names:
        rows = [(None, 0), *(difference(traces[0], trace, name) for trace in traces[1:])]
        channels[name] = {
            "unit": unit(traces, name),
            "rms_difference": [rms for rms, _ in rows],
            "samples_compared": [samples for _, samples in rows],
        }
    files = [
        {
            "file": trace.file,
            "rate_Hz": trace.rec.rate_Hz,
            "samples": len(trace.rec),
            "shift_s": -trace.shift_s,
            "begin_s": trace.begin_s,
            "end_s": trace.end_s,
            "gaps": trace.rec.meta.get("gaps"),
            "lost_samples": trace.rec.meta.get("lost_samples"),
            "closed": trace.rec.meta.get("closed"),
        }
        for trace in traces
    ]
    return {"align": how, "files": files, "channels": channels}


def plot(traces: list[Trace], names: list[str], how: str, path: Path) -> Path:
    """Draws a row per channel, with a colour per recording, and references where they are known.
    Lost samples are shaded, trips are marked."""
    titles = {trace.title for trace in traces}
    common = titles.pop() if len(titles) == 1 else ""
    height_in = HEAD_IN + 0.16 * len(traces) + 0.25 * bool(common) + ROW_IN * max(2, len(names))
    figure, axes = new_figure(len(names), 1, height_in, sharex=True)
    if common:
        figure.suptitle(common, fontsize=11.5, color=INK)
    begin_s = min(t.begin_s for t in traces)
    end_s = max(t.end_s for t in traces)
    scale, time_unit = (1e3, "ms") if end_s - begin_s <= 0.5 else (1.0, "s")
    for ax, name in zip(axes[:, 0], names, strict=True):
        for number, trace in enumerate(traces):
            _draw(ax, trace, name, scale, number, len(traces))
            _mark_trips(ax, trace, scale, number, len(traces), with_text=ax is axes[0, 0])
        if how == "trigger":
            ax.axvline(0, color=INK, linewidth=0.8, linestyle=(0, (4, 3)), zorder=1.5)
        ax.set_title(name, loc="left", pad=3, **TITLE)
        ax.set_ylabel(unit(traces, name), **LABEL)
        ax.margins(y=0.08)
    axes[0, 0].set_xlim(scale * begin_s, scale * end_s)
    since = {"trigger": " after the trigger", "start": " since the start", "none": ""}[how]
    axes[-1, 0].set_xlabel(f"time{since} [{time_unit}]", **LABEL)
    figure.align_ylabels(axes[:, 0])
    lines = [ax_line for ax_line in axes[0, 0].lines if not ax_line.get_label().startswith("_")]
    texts = [trace.legend(with_title=not common) for trace in traces]
    if referred := [line for ax in axes.flat for line in ax.lines if line.get_gid() == REFERENCE]:
        lines, texts = [*lines, referred[0]], [*texts, "reference"]
    figure.legend(lines, texts, loc="outside upper left", **LEGEND)
    return save(figure, path)


def _draw(ax: Axes, trace: Trace, name: str, scale: float, number: int, many: int) -> None:
    colour = COLOURS[number % len(COLOURS)]
    y = np.asarray(values(trace.rec, name), float)
    t = scale * trace.time_s
    # The first line is wider and below the others, so that it stays visible under them.
    wide = number == 0 and many > 1
    ax.plot(*thin(t, y), color=colour, linewidth=2.2 if wide else 1.0,
            alpha=0.55 if wide else 1.0, label=trace.label)  # fmt: skip
    wanted = reference(trace.rec, name)
    if wanted is not None and np.isfinite(wanted).any():
        ax.plot(*thin(t, np.asarray(wanted, float)), "--", linewidth=1.0, gid=REFERENCE,
                color=INK if many == 1 else colour, label="_reference")  # fmt: skip
    if np.isfinite(y).any():
        _shade(ax, t, ~np.isfinite(y), colour)


def _mark_trips(
    ax: Axes, trace: Trace, scale: float, number: int, many: int, with_text: bool
) -> None:
    colour = TRIP_COLOUR if many == 1 else COLOURS[number % len(COLOURS)]
    for time_s, faults in trips(trace.rec):
        at = scale * (time_s - trace.shift_s)
        ax.axvline(at, color=colour, linewidth=1.0, linestyle=":", zorder=1.6)
        if with_text:
            ax.annotate(f"trip: {faults}", (at, 1), xycoords=("data", "axes fraction"), fontsize=8,
                        xytext=(-3, 3 + 9 * number), textcoords="offset points", ha="right",
                        color=colour, annotation_clip=True)  # fmt: skip


def _shade(ax: Axes, t: np.ndarray, lost: np.ndarray, colour: str) -> None:
    """Shade the spans without samples, behind the lines."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost.astype(np.int8), [0]])))
    step = t[1] - t[0] if len(t) > 1 else 0.0
    spans = [(t[0] + step * (a - 0.5), step * (b - a)) for a, b in edges.reshape(-1, 2)]
    if spans:
        ax.broken_barh(spans, (0, 1), transform=ax.get_xaxis_transform(), zorder=0.5,
                       color=colour, alpha=0.18, linewidth=0)  # fmt: skip
