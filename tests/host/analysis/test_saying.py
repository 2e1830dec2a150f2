"""The sentences say what the figures are: every number is computed here by hand."""

import re

import pytest

from hexatorque.analysis.saying import sentences

POINT = "paper-b: 2500 r/min, 2 N m: "


@pytest.fixture
def run_with(make_run):
    """A run of which these figures are set, and nothing else is known."""

    def make(
        scheme, ripple=None, thd=None, xy=None, f_sw=None, td=True, latency="predicted", **more
    ):
        run = make_run(scheme=scheme, latency=latency, **more)
        run.metrics |= {
            "torque_ripple_td_Nm": ripple if td else None,
            "torque_ripple_Nm": ripple,
            "thd_inf_pct": thd,
            "ixy_rms_A": xy,
            "f_sw_Hz": f_sw,
        }
        return run

    return make


def test_one_scheme_alone(run_with):
    assert sentences([run_with("ddr", 0.5, 10.0, 0.06, 3280.0)], {}) == [
        f"{POINT}DDR has torque ripple Td 0.5 N m, distortion THD∞ 10 %, x–y current 0.06 A and "
        "switching frequency 3.28 kHz."
    ]


def test_what_is_not_known_is_not_said(run_with):
    assert sentences([run_with("ddr", 0.5, td=False)], {}) == [
        f"{POINT}DDR has torque ripple 0.5 N m."
    ]
    assert sentences([run_with("ddr")], {}) == [f"{POINT}no figure could be computed."]
    two = [run_with("fdr", 0.5), run_with("ddr", f_sw=3000.0)]
    assert sentences(two, {}) == [f"{POINT}FDR and DDR have no figure in common."]
    assert sentences([*two, run_with("foc", thd=1.0)], {})[-1].endswith(
        "no figure could be computed."
    )


def test_two_schemes_are_compared_and_the_largest_difference_comes_first(run_with):
    two = [run_with("fdr", 0.5, 10.0, 0.2, 3000.0), run_with("ddr", 0.51, 10.0, 0.06, 4500.0)]
    assert sentences(two, {}) == [
        f"{POINT}DDR has 0.3 of FDR's x–y current at 1.50 times its switching frequency, 1.02 "
        "times its torque ripple Td and 1.00 times its distortion THD∞."
    ]


def test_an_x_y_current_that_is_rounding_is_compared_with_none(run_with):
    """Sets 0 or 60 degrees apart have none under dtc1."""
    two = [run_with("dtc1", 0.6, 20.0, 5e-14, 2000.0), run_with("foc", 0.3, 2.0, 4e-4, 4000.0)]
    for run in two:
        run.metrics["i1_A"] = 2.0
    line = sentences(two, {})[0]
    assert line.startswith(f"{POINT}FOC has 0.1 of DTC1's distortion") and "x–y" not in line


def test_a_mean_torque_off_its_reference_is_told(run_with):
    runs = [run_with("fdr", 0.4), run_with("ddr", 0.4), run_with("foc", 0.4), run_with("dtc1", 0.4)]
    for run, percent, error_Nm in zip(runs, (-12.0, 3.0, -1.9, None), (-3.4, 0.9, -0.5, None)):
        run.metrics |= {"torque_error_pct": percent, "torque_error_Nm": error_Nm}
    said = [line for line in sentences(runs, {}) if "mean torque" in line]
    assert said == [
        f"{POINT}the mean torque is off its reference: below by 12 % (3.4 N m) under FDR and above "
        "by 3 % (0.9 N m) under DDR; within 2 % under FOC."
    ]
    assert not [line for line in sentences([runs[2]], {}) if "mean torque" in line]


def test_one_figure_in_common_has_no_at(run_with):
    two = [run_with("fdr", 0.5), run_with("ddr", 0.25)]
    assert sentences(two, {}) == [f"{POINT}DDR has 0.5 of FDR's torque ripple Td."]


def test_a_figure_of_0_has_no_ratio(run_with):
    two = [run_with("fdr", 0.5, xy=0.0), run_with("ddr", 0.25, xy=0.1)]
    assert sentences(two, {}) == [f"{POINT}DDR has 0.5 of FDR's torque ripple Td."]


def test_many_schemes_the_papers_pairs_first_then_the_best_and_the_worst(run_with):
    runs = [
        run_with("fdr", 0.4, 10.0, f_sw=3000.0),
        run_with("ddr", 0.4, 5.0, f_sw=3000.0),
        run_with("foc", 0.1, 5.05, f_sw=3001.0),
    ]
    assert sentences(runs, {}) == [
        f"{POINT}DDR has 0.5 of FDR's distortion THD∞ at 1.00 times its torque ripple Td and 1.00 "
        "times its switching frequency.",
        f"{POINT}torque ripple Td from 0.1 N m (FOC) to 0.4 N m (DDR); distortion THD∞ from 5 % "
        "(DDR and FOC) to 10 % (FDR); switching frequency 3 kHz under all.",
    ]


@pytest.mark.parametrize(
    ("ripples", "said"),
    [
        (
            {"none": 0.2, "shadow": 0.5, "predicted": 0.25},
            "a delay of one period (shadow) makes FDR's torque ripple 2.50 times that without "
            "latency (none); with prediction (predicted) it is 1.25 times.",
        ),
        (
            {"none": 0.2, "shadow": 0.5},
            "a delay of one period (shadow) makes FDR's torque ripple 2.50 times that without "
            "latency (none).",
        ),
        ({"shadow": 0.5, "predicted": 0.25}, None),
    ],
)
def test_what_latency_does(ripples, said, run_with):
    runs = [run_with("fdr", ripple, latency=name) for name, ripple in ripples.items()]
    assert sentences(runs, {})[1:] == ([f"{POINT}{said}"] if said else [])


def test_points_are_told_apart(run_with):
    lines = sentences([run_with("ddr", 1.0), run_with("ddr", 2.0, load_Nm=1.0)], {})
    assert [line.split(" N m: ")[0] for line in lines] == [
        "paper-b: 2500 r/min, 2",
        "paper-b: 2500 r/min, 1",
    ]


def test_a_distortion_far_from_the_printed_one_gets_its_reason(make_run):
    run = make_run(scheme="dtc1")
    ours = run.metrics["thd_pct"]["5kHz"]

    def said(printed, why="the paper does not print it"):
        reference = {"paper-b": {"schemes": {"dtc1": {"thd_pct": printed}}, "why_thd": why}}
        return [line for line in sentences([run], reference) if "printed one" in line]

    (line,) = said(ours / 1.4)
    assert re.search(rf"DTC1 {ours:.1f} beside {ours / 1.4:.1f} %\): the paper does not", line)
    assert said(ours / 1.2) == [] and said(1.2 * ours) == []
    assert said(1.4 * ours) and said(ours / 1.4, "") == []
