"""Host and target of the processor in the loop, both in this process: the protocol, the data that
it carries and the errors that it notices."""

import numpy as np
import pytest

from hexatorque import firmware
from hexatorque.boards.processor import (
    Target,
    TargetController,
    TargetError,
    WatchedController,
    image_names,
)
from hexatorque.drive.simulated import SimulatedDrive
from hexatorque.evidence.studies import pil
from hexatorque.firmware import Controller, FirmwareError, ffi, lib
from hexatorque.setups import Profile

PROFILE = Profile(
    duration_s=0.4, speed_rpm=((0.11, 100.0), (0.25, -200.0)), load_Nm=((0.2, 5.0),),
    set=((0.22, "scheme", "dtc3"), (0.3, "scheme", "ddr")), samples_per_period=1,
)  # fmt: skip


@pytest.fixture
def target():
    with Target() as target:
        yield target


@pytest.mark.parametrize("latency", ["predicted", "immediate"])
@pytest.mark.parametrize("device", firmware.DEVICES)
def test_local_target_equals_the_drive_itself(quick, target, device, latency):
    setup = quick.changed(timing__device=device, timing__latency=latency)
    outcome = pil.compare(setup, PROFILE, target)
    assert outcome.difference is None
    assert (outcome.steps, outcome.state) == (4000, "run")


def test_a_target_starts_afresh(quick, target):
    """Drive after drive on one target, as after a reset each time."""
    for device in (*firmware.DEVICES, firmware.DEVICES[0]):
        setup = quick.changed(timing__device=device)
        assert pil.compare(setup, PROFILE, target).difference is None


def test_same_recording(quick, target):
    """Names, units and meta data are those of any simulation."""
    recordings = []
    for controller in (Controller, target.controller):
        sim = SimulatedDrive(quick, 1, controller)
        sim.run_profile(PROFILE)
        recordings.append(sim.take())
    a, b = recordings
    assert a.units == b.units
    own = {"processor", "started"}
    assert {k: v for k, v in a.meta.items() if k not in own} == {
        k: v for k, v in b.meta.items() if k not in own
    }
    assert (a.meta["processor"], b.meta["processor"]) == ("host", "local")
    assert all(np.array_equal(a[name], b[name], equal_nan=True) for name in a.channels)


class Meddling(Target):
    """A target that is tampered with once, at its n-th exchange after INIT."""

    def __init__(self, meddle):
        super().__init__()
        self.meddle = meddle

    def controller(self, device, values):
        controller = super().controller(device, values)
        start = controller.start

        def meddle_and_start():
            start()
            self.meddle(self)

        controller.start = meddle_and_start
        return controller


def one_ulp(values):
    return float(np.nextafter(np.float32(values), np.float32(np.inf)))


def test_smallest_change_of_a_parameter_shows(quick):
    """The stator resistance differs by one unit in the last place."""

    def meddle(target):
        drive = target._local.pil.drive
        params = firmware.parameters()
        value = one_ulp(drive.params.v[params["rs_ohm"].id])
        assert lib.ht_drive_set(ffi.addressof(drive), params["rs_ohm"].id, value) == lib.HT_OK

    outcome = pil.compare(quick, PROFILE, Meddling(meddle))
    assert outcome.difference is not None
    assert outcome.failures()


def test_one_bit_of_the_state_shows(quick):
    """The stator resistance that the idle drive's observer uses."""

    def meddle(target):
        drive = target._local.pil.drive
        drive.flux_unknown = 0.0  # else a drive with its gates off forgets what it has learnt
        drive.control.observer.rs_ohm = one_ulp(drive.control.observer.rs_ohm)

    outcome = pil.compare(quick, PROFILE, Meddling(meddle))
    assert "rs_ohm" in outcome.difference


def test_one_bit_of_a_register_shows(quick):
    """A register that the firmware writes at start only, on the target's side."""

    def meddle(target):
        target._local.pil.side.registers.word[0x6800 + 0x40 + 0x10] ^= 1  # dead time of leg 2

    outcome = pil.compare(quick, PROFILE, Meddling(meddle))
    assert outcome.difference.startswith("period 0: EPWM2.DBRED is 0x")


def test_different_register_files_are_noticed(quick):
    """A register that the host believes to know, changed behind both ends' backs."""

    def meddle(target):
        target.link.mirror.agreed[10] ^= 1
        target.link.mirror.cell[10][0] ^= 1

    with pytest.raises(TargetError, match="host and target see different hardware"):
        pil.compare(quick, PROFILE, Meddling(meddle))


def test_damaged_frame_is_noticed(quick):
    def meddle(target):
        target.link.flip_request = 9

    with pytest.raises(TargetError, match="did not arrive whole"):
        pil.compare(quick, PROFILE, Meddling(meddle))


def test_a_link_stays_down(quick, target):
    """After an error every request fails at once."""
    controller = target.controller("f28335", quick.controller_values())
    target.link.flip_request = 9
    with pytest.raises(TargetError):
        controller.start()
    for call in (controller.start, controller.stop, controller.clear):
        with pytest.raises(TargetError, match="did not arrive whole"):
            call()


def test_verbs_answer_as_the_drive_does(quick, target):
    """The same calls on a target and on the host: same results, same refusals."""
    values = quick.controller_values()
    here, there = Controller("f28335", values), target.controller("f28335", values)

    def both(verb, *arguments):
        said = []
        for controller in (here, there):
            try:
                said.append(getattr(controller, verb)(*arguments))
            except FirmwareError as error:
                said.append(str(error))
        assert said[0] == said[1]
        assert (here.state, here.faults) == (there.state, there.faults)
        return said[0]

    assert both("get", "scheme") == "ddr"
    both("set", "scheme", "fdr")
    assert both("get", "scheme") == "fdr"
    assert both("get", "rs_ohm") == pytest.approx(values["rs_ohm"])
    assert "range" in both("set", "rs_ohm", -1.0)
    assert "fit together" in both("set", "flux_min_Wb", 90.0)
    assert "not allowed" in both("clear")
    assert both("start") is None
    assert "not allowed" in both("start")
    assert "not allowed" in both("set", "pole_pairs", 3)
    assert both("stop") is None
    both("set", "pole_pairs", 3)
    assert both("get", "pole_pairs") == 3
    assert both("channel", "rs_ohm") == pytest.approx(values["rs_ohm"])


def test_a_trip_is_sent(quick, target):
    """A trip pin on the host's side reaches the drive, its fault comes back, a clear works."""
    sim = SimulatedDrive(quick, 1, target.controller)
    sim.start()
    sim.run(0.105)
    assert sim.controller.state == "run"
    words = sim.controller.register_words()
    for leg in range(6):
        words[0x6800 + 0x40 * leg + 0x16] |= 4  # TZFLG.OST
    sim.run(0.001)
    assert sim.controller.faults == ["external trip"]
    assert sim.controller.state == "fault"
    sim.clear()
    assert (sim.controller.state, sim.controller.faults) == ("idle", [])


def test_the_snapshot_of_a_fault_is_sent(quick, target):
    """Current limit below what the flux needs: the same fault, and the same left of it."""
    setup = quick.changed(controller__i_trip_A=6.0)
    outcome = pil.compare(setup, Profile(duration_s=0.2, samples_per_period=1), target)
    assert outcome.difference is None
    assert outcome.faults == ["over-current"]
    assert outcome.snapshot["faults"] == ["over-current"]
    assert 0 < outcome.snapshot["tick"] < 2000
    assert max(map(abs, outcome.snapshot["i_A"])) > 6.0


def test_every_word_of_a_snapshot_is_sent_in_its_place(quick, target):
    controller = target.controller("f28335", quick.controller_values())
    assert controller.snapshot is None
    s = target._local.pil.drive.snapshot
    s.tick, s.state, s.faults, s.samples.position = 0x12345, 3, 5, 0xFEDC0007
    s.samples.adc[0:7] = range(100, 107)
    measured = getattr(s, "in")
    measured.i_A.p[0:6] = range(11, 17)
    measured.vdc_V, measured.torque_ref_Nm, measured.flux_ref_Wb = 17, 18, 19
    s.estimate.psi_Wb = [20, 21]
    s.estimate.torque_Nm, s.speed_rpm = 22, 23
    kept = controller.snapshot
    assert kept == firmware.snapshot_of(s)
    assert [kept["tick"], kept["position_counts"]] == [0x12345, 0xFEDC0007]
    rest = ("vdc_V", "torque_ref_Nm", "flux_ref_Wb")
    assert [*kept["i_A"], *(kept[name] for name in rest)] == list(range(11, 20))
    assert [*kept["psi_Wb"], kept["torque_Nm"], kept["speed_rpm"]] == [20, 21, 22, 23]


def test_snapshot_that_differs_is_noticed(quick, target, monkeypatch):
    """The least bit of one value."""
    real = TargetController.snapshot.fget

    def off(controller):
        kept = real(controller)
        return kept and {**kept, "speed_rpm": one_ulp(kept["speed_rpm"])}

    monkeypatch.setattr(TargetController, "snapshot", property(off))
    setup = quick.changed(controller__i_trip_A=6.0)
    outcome = pil.compare(setup, Profile(duration_s=0.2, samples_per_period=1), target)
    assert outcome.difference.startswith("fault snapshot: speed_rpm is ")


def test_reading_a_snapshot_changes_nothing(quick, target):
    """It changes no register, access counter or mirror: the run continues unchanged."""
    controller = target.controller("f28335", quick.controller_values())
    parts = ffi.addressof(target.link.registers), ffi.addressof(target._local.pil.drive)
    before = [bytes(ffi.buffer(part)) for part in parts]
    assert controller.snapshot is None
    assert before == [bytes(ffi.buffer(part)) for part in parts]


def test_no_snapshot_before_init(target):
    lib.ht_link_snapshot(target.link, ffi.new("ht_snapshot *"))
    assert target.link.error == lib.HT_LINK_REFUSED


def test_nothing_before_init(target):
    lib.ht_link_request(target.link, lib.HT_OP_PIL_START, 0, 0.0)
    assert target.link.error == lib.HT_LINK_REFUSED


def test_unknown_request(quick, target):
    target.controller("f28335", quick.controller_values())
    lib.ht_link_request(target.link, 99, 0, 0.0)
    assert target.link.error == lib.HT_LINK_REFUSED


def test_other_firmware_is_refused(quick, target, monkeypatch):
    """Both ends compare the names of parameters and channels."""
    real = lib.ht_pil_identify

    class Elsewhere:
        def __getattr__(self, name):
            return getattr(lib, name)

        def ht_pil_identify(self, identity):
            real(identity)
            identity.names ^= 1

    monkeypatch.setattr("hexatorque.boards.processor.lib", Elsewhere())
    with pytest.raises(TargetError, match="another version"):
        target.controller("f28335", quick.controller_values())


def test_values_are_checked_before_the_target_sees_them(target):
    with pytest.raises(FirmwareError, match="rs_ohm"):
        target.controller("f28335", {"rs_ohm": -1.0})


@pytest.mark.parametrize("device", firmware.DEVICES)
def test_image_has_every_epwm_register_of_the_map(device):
    """Names of the image against the map's own fields."""
    controller = WatchedController(device, {})
    names = image_names(controller)
    fields = [name for name, _ in ffi.typeof("ht_c2000_map").fields]
    first, last = fields.index("tbctl"), fields.index("etps")
    for field in set(fields[first : last + 1]) - {"one_shot"}:  # a value, no register
        if getattr(controller.map, field) != 0xFFFF:
            for leg in range(1, 7):
                assert f"EPWM{leg}.{field.upper()}" in names
    assert len(names) == controller.log.images.shape[1]
