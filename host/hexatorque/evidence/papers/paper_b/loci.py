"""Paper B's stator flux loci in both planes (Figs. 10 to 12)."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ....analysis import plots
from ....analysis.spectrum import low_pass
from ....recording.recording import Recording
from ..engine.figure import Figure, Verdict, claim, not_printed
from ..engine.job import Job
from .common import COLOUR, control_instants, excerpt, mean, point, runs_around

#: The shown span: two turns.
LOCUS_S = 0.048
CHANNELS = ("psi_alpha_Wb", "psi_beta_Wb", "psi_x_Wb", "psi_y_Wb")
#: Below this frequency the choice between two vectors has an effect. Above it, the single vector
#: sets the x-y flux.
SLOW_HZ = 1e3
WHY_DTC3 = (
    "In the x–y plane the small vectors are the longest. One period of a small vector moves the "
    "flux by 0.019 Wb, one period of a large vector by 0.005 Wb. Below 1 kHz the difference is "
    "small."
)


def _locus(rec: Recording) -> dict[str, float]:
    """The radii of the estimated flux in both planes, at the control instants."""
    rec = control_instants(rec)
    dq = np.hypot(rec["psi_alpha_Wb"], rec["psi_beta_Wb"])
    xy = np.hypot(rec["psi_x_Wb"], rec["psi_y_Wb"])
    slow = [low_pass(rec[f"psi_{axis}_Wb"], rec.rate_Hz, SLOW_HZ) for axis in "xy"]
    return {
        "dq_mean_Wb": float(dq.mean()),
        "dq_std_Wb": float(dq.std()),
        "xy_rms_Wb": float(np.sqrt(np.mean(xy**2))),
        "xy_max_Wb": float(xy.max()),
        "xy_slow_rms_Wb": float(np.sqrt(np.mean(slow[0] ** 2 + slow[1] ** 2))),
    }


def _loci(job: Job, scheme: str, others: tuple[str, ...]) -> tuple[Figure, dict]:
    """The locus of `scheme`, with the x-y locus of DTC1 behind it. `others` are run as well."""
    runs = runs_around(job, (scheme, *others))
    radii = {name: mean([_locus(run.recording) for run in many]) for name, many in runs.items()}
    shown = {
        name: excerpt(control_instants(runs[name][0].recording), CHANNELS, LOCUS_S)
        for name in dict.fromkeys((scheme, "dtc1"))
    }
    reach = 1.08 * radii["dtc1"]["xy_max_Wb"]

    def draw(path: Path) -> Path:
        figure, axes = plots.new_figure(1, 2, 5.0)
        rec = shown[scheme]
        line = {"color": COLOUR[scheme], "linewidth": 0.7}
        axes[0, 0].plot(rec["psi_alpha_Wb"], rec["psi_beta_Wb"], **line)
        if scheme != "dtc1":
            back = shown["dtc1"]
            axes[0, 1].plot(back["psi_x_Wb"], back["psi_y_Wb"], color=plots.FAINT, linewidth=0.7,
                            label="DTC1")  # fmt: skip
        axes[0, 1].plot(rec["psi_x_Wb"], rec["psi_y_Wb"], label=scheme.upper(), **line)
        axes[0, 1].set_xlim(-reach, reach)
        axes[0, 1].set_ylim(-reach, reach)
        axes[0, 1].legend(loc="upper left", **plots.LEGEND)
        turn = 1.25 * radii[scheme]["dq_mean_Wb"]
        axes[0, 0].set_xlim(-turn, turn)
        axes[0, 0].set_ylim(-turn, turn)
        for axis, plane, names in zip(axes[0], ("d–q", "x–y"), (("d", "q"), ("x", "y"))):
            axis.set_aspect("equal")
            axis.set_title(f"{scheme.upper()}, {plane} subspace", **plots.TITLE)
            axis.set_xlabel(rf"$\psi_{names[0]}$ [Wb]", **plots.LABEL)
            axis.set_ylabel(rf"$\psi_{names[1]}$ [Wb]", **plots.LABEL)
        own = radii[scheme]
        plots.note(axes[0, 0], f"mean {own['dq_mean_Wb']:.3f} Wb, std {own['dq_std_Wb']:.4f} Wb")
        plots.note(axes[0, 1], f"rms {own['xy_rms_Wb']:.4f} Wb, largest {own['xy_max_Wb']:.4f} Wb")
        return plots.save(figure, path)

    own = radii[scheme]
    figure = Figure(
        metrics=radii,
        verdicts=[
            not_printed("x–y flux, rms", own["xy_rms_Wb"], "Wb"),
            not_printed("x–y flux, largest", own["xy_max_Wb"], "Wb"),
        ],
        draw=draw,
        recordings={"" if name == scheme else name: rec for name, rec in shown.items()},
        setups=[point(name).setup for name in runs],
        caption="Estimated stator flux at the control instants, 2500 r/min and 2 N m, two turns. "
        "The radii are means over five loads within 2 % (quick: three), with 0.5 s each."
        + ("" if scheme == "dtc1" else " Grey: the x–y locus of DTC1."),
    )
    return figure, radii


def _ratio(radii: dict, key: str, scheme: str, other: str) -> float:
    return radii[scheme][key] / radii[other][key]


def _beside_dtc1(radii: dict, scheme: str, why: str = "") -> list[Verdict]:
    own = radii[scheme]
    radius = 100 * abs(_ratio(radii, "dq_mean_Wb", scheme, "dtc1") - 1)
    rms, largest = (_ratio(radii, f"xy_{key}_Wb", scheme, "dtc1") for key in ("rms", "max"))
    slow = _ratio(radii, "xy_slow_rms_Wb", scheme, "dtc1")
    return [
        claim("radius in d–q, change from DTC1 in %", radius < 1, radius, "the same"),
        _circle(own),
        claim("x–y flux over DTC1's, rms", rms < 0.6, rms, "much smaller", why=why),
        claim("x–y flux over DTC1's, largest", largest < 0.6, largest, "much smaller", why=why),
        claim("x–y flux over DTC1's, rms below 1 kHz", slow < 0.6, slow, "much smaller"),
    ]


def _circle(own: dict) -> Verdict:
    spread = 100 * own["dq_std_Wb"] / own["dq_mean_Wb"]
    return claim("spread of the radius in d–q, %", spread < 5, spread, "a circle")


def b10(job: Job) -> Figure:
    """Flux loci of DTC1, which does not control the x-y plane."""
    figure, radii = _loci(job, "dtc1", ())
    figure.verdicts += [_circle(radii["dtc1"])]
    return figure


def b11(job: Job) -> Figure:
    """Flux loci of DTC2."""
    figure, radii = _loci(job, "dtc2", ("dtc1",))
    figure.verdicts += _beside_dtc1(radii, "dtc2")
    return figure


def b12(job: Job) -> Figure:
    """Flux loci of DTC3."""
    figure, radii = _loci(job, "dtc3", ("dtc1", "dtc2"))
    rms, slow = (_ratio(radii, f"xy_{key}_Wb", "dtc3", "dtc2") for key in ("rms", "slow_rms"))
    figure.verdicts += [
        *_beside_dtc1(radii, "dtc3", WHY_DTC3),
        claim("x–y flux over DTC2's, rms", rms < 1.15, rms, "insignificantly higher",
              why=WHY_DTC3),
        claim("x–y flux over DTC2's, rms below 1 kHz", slow < 1.15, slow,
              "insignificantly higher"),
    ]  # fmt: skip
    return figure
