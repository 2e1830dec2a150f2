"""Stand-ins for the simulation and for the search of the limit."""

import pytest

from hexatorque.evidence.methods import bench, carrier, limit


@pytest.fixture
def replaced(monkeypatch):
    """Replaces the simulation by a function of scheme, controller's values and point. Returns the
    list of what is measured."""

    def replace(figures):
        calls = []

        def one(scheme, values, place, *rest, **named):
            found = figures(scheme, values, place)
            calls.append((scheme, values, named))
            return found

        monkeypatch.setattr(bench, "measure", one)
        least = limit.Point(0.0, carrier.Ripple(0.5, 0.01, 1.0, 0.1))
        monkeypatch.setattr(limit, "front", lambda *_: [least, least])
        return calls

    return replace


def alike(scheme, values, place):
    """f_sw is a fifth of f_isr, and Td times f_sw is constant. Above 40 kHz the drive does not hold
    the point."""
    f_isr = values["f_isr_Hz"]
    if f_isr > 40e3:
        return None
    f_sw = f_isr / 5
    return {"f_sw_Hz": f_sw, "td_Nm": 300 / f_sw, "thd_inf_pct": 1e4 / f_sw, "ixy_rms_A": 0.1,
            "loss_W": 50.0, "idc_ripple_A": 1.0, "flux_Wb": 0.39}  # fmt: skip


def ours_is_better(scheme, values, place):
    """Ours has half the Td and nine tenths of the THD of others. Wide bands switch little."""
    found = alike(scheme, values, place)
    if found is None:
        return None
    ours = scheme == "db-dtfc"
    band = values.get("torque_band_Nm", 0.5) / place.base.parameter("torque_band_Nm")
    f_sw = values["f_isr_Hz"] / 2 if ours else 0.2 * values["f_isr_Hz"] / band
    return found | {
        "f_sw_Hz": f_sw, "td_Nm": (150 if ours else 300) / f_sw,
        "thd_inf_pct": 1e4 / f_sw * (0.9 if ours else 1.0), "flux_Wb": 0.35,
    }  # fmt: skip


@pytest.fixture
def counted(replaced):
    return replaced(alike)


@pytest.fixture
def unequal(replaced):
    return replaced(ours_is_better)
