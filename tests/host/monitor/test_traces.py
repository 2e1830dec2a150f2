"""The ring and its envelopes, compared with a table that keeps every sample."""

from types import SimpleNamespace

import numpy as np
import pytest

from hexatorque.monitor.traces import Ring, Traces, View


def samples(seed: int, blocks: int, most: int, hole: float) -> list[tuple]:
    """Blocks of (numbers, values) as a line delivers them: in order, some samples missing."""
    rng = np.random.default_rng(seed)
    at, out = 1_000_000, []
    for _ in range(blocks):
        numbers = at + np.arange(rng.integers(1, most))
        numbers = numbers[rng.random(len(numbers)) >= hole]
        at = int(numbers[-1]) + 1 + int(rng.integers(0, 3)) if len(numbers) else at + most
        out.append((numbers, rng.normal(size=(len(numbers), 2)).astype(np.float32)))
    return out


def table(blocks: list[tuple]) -> dict[int, np.ndarray]:
    return {int(n): v for numbers, values in blocks for n, v in zip(numbers, values)}


def by_hand(kept: dict, width: int, first: int, last: int, oldest: int) -> list[tuple]:
    """For each bin (2, 2): smallest and largest value of both channels; None if it is empty."""
    out = []
    for bin in range(first, last):
        numbers = range(max(oldest, bin * width), (bin + 1) * width)
        rows = np.array([kept[n] for n in numbers if n in kept])
        out.append((rows.min(axis=0), rows.max(axis=0)) if len(rows) else None)
    return out


def assert_bins(lo: np.ndarray, hi: np.ndarray, wanted: list) -> None:
    assert lo.shape == hi.shape == (2, len(wanted))
    for low, high, want in zip(lo.T, hi.T, wanted):
        if want is None:
            assert np.isnan(low).all() and np.isnan(high).all()
        else:
            np.testing.assert_array_equal(low, want[0])
            np.testing.assert_array_equal(high, want[1])


@pytest.mark.parametrize("hole", [0.0, 0.2])
@pytest.mark.parametrize("width", [1, 7])
def test_the_envelope_covers_all_samples_of_the_ring(width, hole):
    blocks = samples(1, 60, 40, hole)
    ring = Ring(2, 300)
    kept: dict[int, np.ndarray] = {}
    for block in blocks:
        ring.push(*block)
        kept |= table([block])
        oldest = max(ring.end - 300, min(kept))
        first, last = (oldest - 20) // width, ring.end // width + 3
        lo, hi = ring.envelope(width, first, last)
        assert_bins(lo, hi, by_hand(kept, width, first, last, oldest))


def test_after_a_gap_longer_than_the_ring_old_samples_are_gone():
    ring = Ring(1, 10)
    ring.push(np.arange(10), np.ones((10, 1), np.float32))
    ring.push(np.array([10**6]), np.full((1, 1), 2, np.float32))
    values = ring.part(10**6 - 12, 10**6 + 2)[0]
    assert values[12] == 2
    assert np.isnan(np.delete(values, 12)).all()


def test_of_a_block_longer_than_the_ring_the_newest_samples_stay():
    ring = Ring(1, 10)
    ring.push(np.arange(35), np.arange(35, dtype=np.float32)[:, None])
    np.testing.assert_array_equal(ring.part(25, 35)[0], np.arange(25, 35))
    assert np.isnan(ring.part(20, 25)).all()


@pytest.mark.parametrize("blocks_between", [1, 30])  # two requests of the page
def test_a_page_that_keeps_all_bins_has_the_envelope(blocks_between):
    blocks = samples(2, 200, 30, 0.05)
    ring = Ring(2, 4000)
    view = View(ring, rate_Hz=1000.0, window_s=0.4, bins=100)
    assert view.width == 4
    page: dict[int, tuple] = {}
    for turn, block in enumerate(blocks):
        ring.push(*block)
        if turn % blocks_between:
            continue
        first, lo, hi = view.news()
        assert lo.shape[1] <= view.count
        page |= {first + i: (lo[:, i], hi[:, i]) for i in range(lo.shape[1])}
        newest = (ring.end - 1) // 4
        bins = range(max(newest - 100, ring.begin // 4), newest + 1)
        assert set(bins) <= set(page)
        lo, hi = (np.array([page[bin][which] for bin in bins]).T for which in (0, 1))
        kept = table(blocks[: turn + 1])
        assert_bins(lo, hi, by_hand(kept, 4, bins[0], bins[-1] + 1, 0))
    assert view.news() is None or ring.end % 4  # a full last bin is not sent again


@pytest.mark.parametrize("rate_Hz", [50.0, 1999.0, 2000.0, 2500.0, 10000.0])
@pytest.mark.parametrize("window_s", [0.1, 1.0, 5.0, 20.0])
def test_a_window_has_a_bin_for_each_pixel_and_at_most_two(window_s, rate_Hz):
    """Or all samples, if there are not that many."""
    pixels, samples = 978, window_s * rate_Hz
    view = View(Ring(1, 10), rate_Hz, window_s, pixels)
    drawn = samples / view.width
    assert drawn >= min(pixels, samples)
    assert drawn <= max(2 * pixels, samples if view.width == 1 else 0)
    assert samples / view.width <= view.count <= samples / view.width + 2


def test_a_page_that_asks_again_at_once_gets_nothing():
    ring = Ring(1, 100)
    view = View(ring, 100.0, 1.0, 50)
    assert view.news() is None
    ring.push(np.arange(20), np.zeros((20, 1), np.float32))
    assert view.news() is not None
    assert view.news() is None


def test_after_a_reset_the_samples_continue_after_a_gap():
    ring = Ring(1, 100)
    ring.push(np.arange(1000, 1020), np.ones((20, 1), np.float32))
    ring.begin_anew(10)
    assert ring.marks == []  # no sample yet
    for first in (3, 8):  # the board's own numbers, after its reset
        ring.push(np.arange(first, first + 5), np.full((5, 1), 2, np.float32))
    assert ring.end == 1020 + 10 + 10 and ring.boards_end == 13
    assert len(ring.marks) == 1 and 1020 <= ring.marks[0] < 1030
    values = ring.part(1000, ring.end)[0]
    assert (values[:20] == 1).all() and np.isnan(values[20:30]).all() and (values[30:] == 2).all()


def test_an_empty_ring_begins_at_the_boards_number():
    ring = Ring(1, 100)
    ring.begin_anew(10)
    ring.push(np.arange(3, 5), np.ones((2, 1), np.float32))
    assert (ring.begin, ring.end, ring.marks) == (3, 5, [])


def test_the_figures_are_means_of_a_quarter_of_a_second():
    """A torque that a comparator controls jumps from sample to sample. A channel whose newest
    sample says nothing has no mean, whatever came before."""
    traces = Traces(None, None, print)
    assert len(traces.mean()) == 0
    rate_Hz = 1000.0
    traces.ring, traces.stream = Ring(3, 4000), SimpleNamespace(rate_Hz=rate_Hz)
    steps = np.arange(2000)
    jumps = np.where(steps % 2, 3.0, -1.0) + np.where(steps < 1700, 100.0, 0.0)
    ended = np.where(steps < 1990, 5.0, np.nan)
    gaps = np.where(steps % 3, 7.0, np.nan)  # lost samples; the newest came
    gaps[-1] = 7.0
    traces.ring.push(steps, np.stack([jumps, ended, gaps], axis=1).astype(np.float32))
    mean = traces.mean()
    assert mean[0] == pytest.approx(1.0) and np.isnan(mean[1]) and mean[2] == pytest.approx(7.0)
