"""Set-ups of the least keys run their profiles to the end, by the commands that a user types."""

import json

import pytest
from campaigns import part
from example_setups import LARGE, SMALL

from hexatorque.cli.main import main
from hexatorque.recording.recording import Recording

#: Above the speed that the voltage reaches with the largest flux, and 1.4 times the rated speed
#: that the large one's own point derives; full speed both ways, a load that comes and drops.
COURSES = {
    "small": (SMALL, "[point]\nspeed_rpm = 2500\nload_Nm = 4\n", 2500, 4),
    "large": (LARGE, "[point]\nspeed_rpm = 1200\nload_Nm = 600\n", 1200, 600),
    "large without a point": (LARGE, "", 1200, 600),
    "large, 1.4 times as fast": (LARGE, "[point]\nspeed_rpm = 1200\nload_Nm = 600\n", 1680, 400),
}
SCHEMES = ("db-dtfc", "ddr", "ddr-ml", "dtc3", "fdr", "foc")
#: At 10 kHz its x-y current reaches the trip.
NOT_READY = ("small", "dtc3")


@pytest.mark.parametrize(
    ("name", "scheme"), part([(name, scheme) for name in COURSES for scheme in SCHEMES], 4)
)
def test_what_check_lets_run_runs_its_profile_to_the_end(tmp_path, capsys, name, scheme):
    machine, point, top_rpm, load_Nm = COURSES[name]
    (tmp_path / "mine.toml").write_text(machine + point)
    first = tmp_path / "first.toml"
    first.write_text(
        f'setup = "mine.toml"\n[controller]\nscheme = "{scheme}"\n[profile]\nduration_s = 7\n'
        f"speed_rpm = [[0.6, {top_rpm}], [3, -{top_rpm}], [6, 0]]\n"
        f"load_Nm = [[2, {load_Nm}], [2.6, 0], [5, -{load_Nm}], [5.6, 0]]\n"
    )
    assert main(["check", str(first), "--json"]) == ((name, scheme) == NOT_READY)
    told = json.loads(capsys.readouterr().out)
    if (name, scheme) == NOT_READY:
        assert "x-y current" in told["not_ready"][scheme]
        return
    # Nobody has told the L_xy of these machines: on the bench some schemes may need more of it.
    assert scheme in (*told["ready"], *told["doubtful"])
    run = tmp_path / "run.npz"
    assert main(["run", str(first), "-o", str(run)]) == 0, capsys.readouterr().err
    rec = Recording.load(run)
    for time_s, wanted_rpm in ((2.5, top_rpm), (5.5, -top_rpm), (6.9, 0)):
        speed_rpm = rec["speed_rpm"][int((time_s - rec.start_s) * rec.rate_Hz)]
        assert abs(speed_rpm - wanted_rpm) < 0.03 * top_rpm, time_s
