"""Files of recordings: every format keeps every value, and other programs can open it. A damaged
file gives one line of error, and never a wrong number."""

import json
import sys

import numpy as np
import pytest
from campaigns import WHOLE, part
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as of_numpy

from hexatorque.recording import formats, mat, mf4
from hexatorque.recording.recording import (
    TYPES,
    Recording,
    RecordingError,
    from_header,
    header_text,
)


def same(a: Recording, b: Recording) -> None:
    """Compare every bit of every sample, and all other data of the recordings."""
    assert list(a.channels) == list(b.channels)
    for name, data in a.channels.items():
        assert b[name].dtype == data.dtype, name
        assert np.array_equal(b[name], data, equal_nan=data.dtype.kind == "f"), name
    assert b.units == {name: a.units.get(name, "") for name in a.channels}
    assert (b.rate_Hz, b.start_s, b.meta) == (a.rate_Hz, a.start_s, a.meta)


def test_a_saved_recording_is_read_unchanged(full, suffix, tmp_path):
    path = full.save(tmp_path / "new" / f"rec{suffix}")
    same(full, Recording.load(path))
    assert sorted(tmp_path.rglob(".*")) == []  # no temporary file is left


@pytest.mark.parametrize("channels", [{}, {"i_u1_A": np.empty(0, np.float32)}])
def test_a_recording_without_samples_is_read_unchanged(channels, suffix, tmp_path):
    rec = Recording(1e4, channels, meta={"why": "stopped at once"})
    same(rec, Recording.load(rec.save(tmp_path / f"rec{suffix}")))


NAMES = st.text(st.characters(exclude_categories=["C", "Z"]), min_size=1)
JSON = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**60), 2**60) | st.text()
    | st.floats(allow_nan=False),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=6,
)  # fmt: skip


@st.composite
def recordings(draw) -> Recording:
    names = draw(
        st.lists(NAMES, max_size=4, unique=True).filter(lambda n: not {"time_s", "tick"} & {*n})
    )
    n = draw(st.integers(0, 20))
    kinds = st.sampled_from(TYPES)
    channels = {name: draw(of_numpy.arrays(np.dtype(draw(kinds)), n)) for name in names}
    return Recording(
        draw(st.floats(1e-3, 1e9)),
        channels,
        {name: draw(st.text(st.characters(exclude_categories=["C"]))) for name in names[:2]},
        draw(st.dictionaries(st.text(), JSON, max_size=3)),
        draw(st.floats(-1e6, 1e6)),
    )


@settings(max_examples=40 if WHOLE else 8, deadline=None, suppress_health_check=list(HealthCheck))
@given(rec=recordings())
def test_any_saved_recording_is_read_unchanged(rec, suffix, tmp_path):
    same(rec, Recording.load(rec.save(tmp_path / f"rec{suffix}")))


def test_a_single_sample_keeps_its_type(suffix, tmp_path):
    rec = Recording(1.0, {kind: np.ones(1, kind) for kind in TYPES}, dict.fromkeys(TYPES, ""))
    same(rec, Recording.load(rec.save(tmp_path / f"rec{suffix}")))


def test_numpy_numbers_in_the_metadata(full, suffix, tmp_path):
    full.meta = {"a": np.float32(0.5), "b": np.int64(3), "c": np.arange(2), "d": tmp_path}
    read = Recording.load(full.save(tmp_path / f"rec{suffix}")).meta
    assert read == {"a": 0.5, "b": 3, "c": [0, 1], "d": str(tmp_path)}


def test_an_mf4_file_has_groups_units_and_its_time(full, tmp_path):
    asammdf = pytest.importorskip("asammdf", reason=".mf4 needs asammdf")
    with asammdf.MDF(full.save(tmp_path / "rec.mf4")) as mdf:
        torque = mdf.get("torque_Nm")
        assert torque.unit == "N m"
        assert np.array_equal(torque.timestamps, full.time_s)
        assert np.array_equal(torque.samples, full["torque_Nm"])
        assert "true value" in mdf.get("plant.i_u1_A").comment
        assert mdf.header.start_time.isoformat() == "2024-05-01T10:34:56.789000+00:00"
        assert "scheme: ddr" in mdf.header.comment


def test_an_mf4_file_of_another_program_is_refused_with_the_way(tmp_path):
    asammdf = pytest.importorskip("asammdf", reason=".mf4 needs asammdf")
    time_s = np.arange(100) / 1e3
    with asammdf.MDF(version="4.10") as mdf:
        mdf.append([asammdf.Signal(np.sin(time_s), time_s, name="i_u1", unit="A")])
        mdf.save(tmp_path / "canape.mf4")
    with pytest.raises(RecordingError, match=r"canape\.mf4: .*another program made it: export it"):
        Recording.load(tmp_path / "canape.mf4")


def test_a_mat_file_has_valid_variables(full, tmp_path):
    io = pytest.importorskip("scipy.io", reason=".mat needs scipy")
    contents = io.loadmat(full.save(tmp_path / "rec.mat"), simplify_cells=True)
    assert np.array_equal(contents["plant_i_u1_A"], full["plant.i_u1_A"], equal_nan=True)
    assert np.array_equal(contents["time_s"], full.time_s)
    assert contents["units"]["torque_Nm"] == "N m"
    assert "end_2" in contents and "end" not in contents  # a keyword
    assert json.loads(contents["recording_json"])["meta"] == full.meta


def test_names_for_matlab_are_valid_and_differ():
    names = ["a.b", "a_b", "a b", "1st", "_x", "ä", "x" * 80, "x" * 70, "time_s", "units"]
    found = mat.variables(names)
    assert len(set(found)) == len(names)
    for name in found:
        assert name.isidentifier() and name.isascii() and name[0].isalpha() and len(name) <= 63
    assert not {"time_s", "units"} & set(found)


def test_a_parquet_file_is_a_table_with_units(full, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet", reason=".parquet needs pyarrow")
    table = parquet.read_table(full.save(tmp_path / "rec.parquet"))
    assert table.column_names == ["time_s", *full.channels]
    assert table.schema.field("torque_Nm").metadata == {b"unit": b"N m"}
    assert table.schema.field("time_s").metadata == {b"unit": b"s"}
    assert np.array_equal(table.column("time_s").to_numpy(), full.time_s)


def test_a_csv_file_is_a_table_and_a_header(full, tmp_path):
    path = full.save(tmp_path / "rec.csv")
    first, second, *_ = path.read_text().splitlines()
    assert first.startswith("time_s,plant.i_u1_A [A],torque_Nm [N m],position,counter,")
    assert "ψ α/x-y [0] #1 [Ω]" in first.split(",")
    assert float(second.split(",")[0]) == 0.35
    assert json.loads((tmp_path / "rec.json").read_text())["units"]["torque_Nm"] == "N m"


# -- refused


@pytest.mark.parametrize("name", ["", " a", "a\nb", "time_s", "tick"])
def test_names_that_a_table_cannot_hold(name, tmp_path):
    with pytest.raises(RecordingError, match="channel"):
        Recording(1.0, {name: np.zeros(2)}).save(tmp_path / "rec.npz")


@pytest.mark.parametrize("data", [np.zeros(2, complex), np.array(["a", "b"]), np.zeros((2, 2))])
def test_samples_that_are_no_numbers(data, suffix, tmp_path):
    with pytest.raises(RecordingError, match="channel 'x'"):
        Recording(1.0, {"x": data}).save(tmp_path / f"rec{suffix}")
    assert list(tmp_path.iterdir()) == []


def test_every_suffix_has_a_module_and_an_extra():
    import tomllib
    from pathlib import Path

    text = (Path(__file__).parents[3] / "pyproject.toml").read_text()
    extras = tomllib.loads(text)["project"]["optional-dependencies"]
    for suffix, library in formats.SUFFIXES.items():
        if library:
            name = library.partition(".")[0]
            assert any(need.startswith(name) for need in extras[suffix[1:]])
            assert suffix[1:] in extras["all-files"][0]


@pytest.mark.parametrize("suffix_needed", [s for s, library in formats.SUFFIXES.items() if library])
def test_an_extra_that_is_missing_is_named(suffix_needed, full, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, formats.SUFFIXES[suffix_needed], None)  # import fails
    path = tmp_path / f"rec{suffix_needed}"
    says = rf"pip install 'hexatorque\[{suffix_needed[1:]}\]'$"
    for call in (full.save, Recording.load, formats.check_output):
        with pytest.raises(RecordingError, match=says):
            call(path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["rec.xls", "rec", "rec.npz.part", "rec.NPZ"])
def test_the_error_for_an_unknown_suffix_lists_the_known_ones(name, full, tmp_path):
    for call in (full.save, formats.check_output):
        with pytest.raises(RecordingError, match=r"use \.csv, \.npz, .* or \.parquet"):
            call(tmp_path / name)


def test_an_output_is_refused_before_it_is_needed(tmp_path):
    assert formats.check_output(tmp_path / "new" / "rec.npz").parent.is_dir()
    assert list((tmp_path / "new").iterdir()) == []
    (tmp_path / "file").write_text("")
    (tmp_path / "rec.npz").mkdir()
    (tmp_path / "rec.json").mkdir()
    for bad in ("file/rec.npz", "rec.npz", "rec.csv"):
        with pytest.raises(RecordingError):
            formats.check_output(tmp_path / bad)
    for bad in ("/proc/no-such/rec.npz", "/proc/rec.npz"):  # root cannot write there either
        with pytest.raises(RecordingError):
            formats.check_output(bad)


def test_a_failed_save_leaves_the_old_file(full, suffix, tmp_path):
    path = full.save(tmp_path / f"rec{suffix}")
    other = Recording(1.0, {"x": np.zeros(3)}, meta={"bad": {(1, 2): "no key for JSON"}})
    with pytest.raises(RecordingError, match="keys must be"):
        other.save(path)
    same(full, Recording.load(path))
    assert not any(file.name.startswith(".") for file in tmp_path.iterdir())


def test_a_failed_write_leaves_no_temporary_file(full, suffix, tmp_path, monkeypatch):
    path = full.save(tmp_path / f"rec{suffix}")
    before = sorted(tmp_path.iterdir())

    def full_disk(rec, draft):
        for file in formats.beside(draft):
            file.write_bytes(b"half of it")
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(formats.module(path), "save", full_disk)
    with pytest.raises(RecordingError, match=f"rec{suffix}: No space left on device"):
        full.save(path)
    assert sorted(tmp_path.iterdir()) == before
    same(full, Recording.load(path))


def test_a_file_is_replaced_in_one_step(full, suffix, tmp_path):
    """A program that has the old file open continues to read the old one."""
    path = full.save(tmp_path / f"rec{suffix}")
    old = path.read_bytes()
    with path.open("rb") as reader:
        Recording(1.0, {"x": np.zeros(3)}).save(path)
        assert reader.read() == old
    assert len(Recording.load(path)) == 3


# -- damaged files


def loads_or_says_so(path) -> str:
    """A file, damaged or not, must give a recording or one line of error. Returns that line."""
    try:
        rec = Recording.load(path)
    except RecordingError as error:
        assert "\n" not in str(error) and str(path) in str(error)
        return str(error)
    assert {len(data) for data in rec.channels.values()} <= {len(rec)}
    return ""


def test_a_truncated_file_says_so(full, suffix, tmp_path):
    """A file that is cut anywhere never gives a shorter recording without an error."""
    path = full.save(tmp_path / f"rec{suffix}")
    raw = path.read_bytes()
    for share in part(np.linspace(0, 0.97, 12), 5):
        path.write_bytes(raw[: int(share * len(raw))])
        assert loads_or_says_so(path), share


def test_a_damaged_file_is_one_line(full, suffix, tmp_path, capfd):
    path = full.save(tmp_path / f"rec{suffix}")
    raw = path.read_bytes()
    seeds = part(range(12 if suffix == ".mf4" else 60), 6)  # each .mf4 is read by a new process
    said = 0
    for seed in seeds:
        random = np.random.default_rng(seed)
        damaged = bytearray(raw)
        for at in random.integers(0, len(raw), random.integers(1, 6)):
            damaged[at] = random.integers(256)
        path.write_bytes(damaged)
        said += bool(loads_or_says_so(path))
    assert said > len(seeds) / 6
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("does", "says"),
    (("kill -SEGV $$", "asammdf crashes"), ("exec sleep 60", "does not come to an end within 1 s")),
)
def test_a_crash_of_the_library_for_mf4_is_one_line(does, says, full, tmp_path, monkeypatch):
    """About one of 800 damaged files makes the compiled code of asammdf 8.8 crash or loop."""
    pytest.importorskip("asammdf", reason=".mf4 needs asammdf")
    path = full.save(tmp_path / "rec.mf4")
    crashes = tmp_path / "python"
    crashes.write_text(f"#!/bin/sh\n{does}\n")
    crashes.chmod(0o755)
    monkeypatch.setattr(mf4, "LONGEST_S", 0.6)
    monkeypatch.setattr(sys, "executable", str(crashes))
    assert says in loads_or_says_so(path)


def test_mf4_samples_that_changed_are_found(full, tmp_path):
    """The library saves changed samples with the old metadata. This is the same as a damaged
    block."""
    asammdf = pytest.importorskip("asammdf", reason=".mf4 needs asammdf")
    with asammdf.MDF(full.save(tmp_path / "rec.mf4")) as mdf:
        signals = [mdf.get(name, raw=True) for name in full.channels]
        signals[3].samples[7] += 1
        with asammdf.MDF() as damaged:
            damaged.append(signals, common_timebase=True)
            damaged.attach(bytes(mdf.extract_attachment(0)[0]), file_name="recording.json")
            damaged.save(tmp_path / "damaged.mf4")
    assert "damaged samples" in loads_or_says_so(tmp_path / "damaged.mf4")


def test_a_header_that_does_not_fit_is_one_line(full, tmp_path):
    path = full.save(tmp_path / "rec.csv")
    header = json.loads((tmp_path / "rec.json").read_text())
    for key, value in [
        ("rate_Hz", 0), ("rate_Hz", "fast"), ("rate_Hz", float("nan")), ("samples", 3),
        ("units", {}), ("units", []), ("units", {"x": "A"}), ("meta", []), ("start_s", None),
        ("types", {"torque_Nm": "object"}),
    ]:  # fmt: skip
        (tmp_path / "rec.json").write_text(json.dumps({**header, key: value}))
        assert loads_or_says_so(path), (key, value)
    (tmp_path / "rec.json").write_text("{")
    assert "its header rec.json cannot be read" in loads_or_says_so(path)


def test_samples_are_not_made_into_another_type():
    header = header_text(Recording(1.0, {"x": np.array([1, 2])}))
    with pytest.raises(TypeError, match="float64"):
        from_header(header, {"x": np.array([1.5, 2.5])})


@pytest.mark.parametrize("content", [b"", b"\0" * 100, b"{}", b"\n" * 400, b"PK\x03\x04", b"MDF "])
def test_another_kind_of_file_under_the_name(content, suffix, tmp_path):
    path = tmp_path / f"rec{suffix}"
    path.write_bytes(content)
    (tmp_path / "rec.json").write_text("{}")
    assert loads_or_says_so(path)
    path.unlink()
    assert "No such file" in loads_or_says_so(path)
    path.mkdir()
    assert "directory" in loads_or_says_so(path)


def test_older_files_are_read(tmp_path):
    """Files of the first form have neither types nor a number of samples."""
    header = {
        "format": "hexatorque-recording-1", "rate_Hz": 10.0, "start_s": 1.0,
        "units": {"a": "A"}, "meta": {},
    }  # fmt: skip
    (tmp_path / "old.json").write_text(json.dumps(header))
    (tmp_path / "old.csv").write_text("time_s,a\n1,0.5\n1.1,nan\n")
    rec = Recording.load(tmp_path / "old.csv")
    assert rec["a"][0] == 0.5 and np.isnan(rec["a"][1]) and rec.time_s[1] == 1.1
