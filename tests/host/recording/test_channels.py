"""Channels of a recording that hold each value for several samples."""

import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from hexatorque.recording.channels import Channels, Held, Product, RowOf
from hexatorque.recording.recording import Recording, RecordingError

VALUES = np.arange(7.0, dtype=np.float32) ** 2
PER = 4
WHOLE = np.repeat(VALUES, PER)


@given(
    st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.booleans()
)
def test_parts_of_parts_are_slices_of_the_repeated_values(a, b, c, d, pickled):
    held = Held(0, len(WHOLE), VALUES, PER).part(a, b).part(c, d)
    channels = Channels({"x": held})
    if pickled:
        channels = pickle.loads(pickle.dumps(channels))
    expected = WHOLE[a:b][c:d]
    assert channels.lengths() == {len(expected)}
    assert np.array_equal(channels["x"], expected)
    assert channels["x"] is channels["x"]  # repeated once


def test_a_window_repeats_nothing_and_gives_the_same_samples():
    rec = Recording(8.0, Channels({"p": WHOLE * 2, "x": Held(0, len(WHOLE), VALUES, PER)}))
    part = rec.window(0.6, 2.0)
    assert len(part) == len(part["x"]) == 11
    assert np.array_equal(part["x"], WHOLE[5:16])
    assert np.array_equal(part["p"], 2 * WHOLE[5:16])
    assert part["p"].base is not None


def test_channels_behave_like_a_dictionary():
    channels = Channels({"x": Held(0, len(WHOLE), VALUES, PER)})
    channels |= {"y": WHOLE}
    both = {"a": WHOLE} | channels
    assert list(both) == ["a", "x", "y"] and list(channels) == ["x", "y"]
    assert list(channels | {"b": WHOLE}) == ["x", "y", "b"]
    assert list({**channels}) == ["x", "y"]
    assert channels.get("no") is None and "no" not in channels and "x" in channels
    assert np.array_equal(channels.pop("x"), WHOLE) and len(channels) == 1


def test_a_held_channel_of_another_length_is_refused():
    with pytest.raises(RecordingError, match="different lengths"):
        Recording(8.0, Channels({"p": WHOLE, "x": Held(0, len(WHOLE) - 1, VALUES, PER)}))


@given(
    st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.integers(0, 30), st.booleans()
)
def test_a_row_of_a_product_is_that_row_whatever_part_is_asked_for(a, b, c, d, pickled):
    weights, values = np.array([[1.0, 2.0], [-3.0, 0.5]]), np.arange(40.0).reshape(20, 2) ** 2
    product = Product(weights, values)
    channels = Channels({str(row): RowOf(0, 20, product, row).part(a, b) for row in range(2)})
    if pickled:
        channels = pickle.loads(pickle.dumps(channels))
    channels = channels.part(c, d)
    for row in range(2):
        expected = (values @ weights[row])[a:b][c:d]
        assert len(channels[str(row)]) == len(expected)
        assert np.allclose(channels[str(row)], expected, rtol=1e-14)
    assert channels["0"].base is not None  # one product for all rows


def test_a_recording_prints_as_a_few_lines():
    channels = {f"plant.channel_{n}_A": np.zeros(50) for n in range(60)}
    rec = Recording(1000.0, channels, meta={"setup": {"a": "b" * 1000}}, start_s=0.25)
    first, second, *names, last = str(rec).splitlines()
    assert first == "0.05 s from 0.25 s on: 50 samples at 1000 Hz"
    assert second == "60 channels:" and names[0].startswith("  plant.channel_0_A, ")
    assert len(names) == 4 and names[-1].endswith(" ...") and last == "meta: setup"
    assert repr(rec) == "<Recording: 50 samples at 1000 Hz, 60 channels>"
    assert str(Recording(1.0, {})) == "0 s from 0 s on: 0 samples at 1 Hz\nno channels"


def test_a_recording_iterates_over_the_names_of_its_channels():
    rec = Recording(8.0, Channels({"x": WHOLE, "plant.x": WHOLE}))
    assert list(rec) == ["x", "plant.x"] and all(name in rec for name in rec)
