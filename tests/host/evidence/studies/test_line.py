"""The link on a line that damages its bytes (docs/protocol.md), and that the study itself
would notice."""

import itertools

import numpy as np
import pytest

from hexatorque.evidence.studies import line
from hexatorque.serial import wire


@pytest.fixture(scope="module")
def result():
    return line.study(quick=True)


def test_nothing_wrong_is_taken_for_right(result):
    assert line.failures(result) == []
    s = result["samples"]
    assert s["sent"] >= 0.99 * line.QUICK_FRAMES
    # 28 bytes on the line, five kinds of damage: about one in eight does not come through.
    assert 0.1 < s["lost"] / s["sent"] < 0.17
    assert s["accepted"] + s["lost"] == s["sent"]
    assert 0 < s["gaps"] < s["lost"]


def test_requests_get_through(result):
    rows = {row["request"]: row for row in result["requests"]}
    assert {"STATUS", "GET", "WRITE", "ARM", "HELLO"} == set(rows)
    for row in rows.values():
        asked = sum(row["tries"]) + row["failed"]
        assert row["failed"] <= 0.06 * asked
        assert sum(row["tries"][1:]) > 0  # some had to be repeated


def test_checks_let_pass_what_their_bits_say(result):
    """Of the damage that COBS leaves, where frames are damaged throughout."""
    row = result["checks"][1]
    assert row["damaged32"] > 0.9 * row["frames"]
    for k, n in row["bits"]:
        expected = row["cobs32"] / 2**k
        assert abs(n - expected) <= 5 * np.sqrt(expected) + 0.08 * expected + 1, k


@pytest.mark.parametrize("rate", [1e-3, 0.05])
def test_damage_is_as_stated(rate):
    """Together as often as said."""
    rng = np.random.default_rng(7)
    n = 400_000
    sent = np.zeros(n, np.uint8)
    arrived = line.damage_bytes(sent, rate, rng)
    # Lost and doubled cancel in the mean; what is inserted remains.
    assert len(arrived) == pytest.approx(n * (1 + rate), abs=6 * np.sqrt(3 * n * rate))
    changed = np.count_nonzero(arrived)
    assert changed == pytest.approx(n * rate * (1 + 255 / 256), abs=6 * np.sqrt(2 * n * rate))
    one_bit = np.isin(arrived, [1 << k for k in range(8)]).sum()
    assert one_bit == pytest.approx(n * rate * (1 + 8 / 256), abs=6 * np.sqrt(n * rate))


def test_each_damage_is_as_frequent_as_stated():
    """Told apart in bytes that count upwards."""
    rng, n = np.random.default_rng(7), 400_000
    up = (np.arange(n) % 251).astype(np.uint8)
    steps = np.diff(line.damage_bytes(up, 1e-3, rng).astype(int)) % 251
    assert np.count_nonzero(steps == 0) > 0.7e-3 * n  # doubled
    assert np.count_nonzero(steps == 2) > 0.7e-3 * n  # lost, or swapped
    assert np.count_nonzero(steps == 250) > 0.7e-3 * n  # swapped
    assert (line.damage_bytes(up, 0.0, rng) == up).all()


def test_a_weaker_check_is_found_out(monkeypatch):
    """With 8 bits of the CRC alone wrong samples come through, and the study says so."""
    real = wire.zlib.crc32

    class Weak:
        @staticmethod
        def crc32(raw, start=0):
            crc = real(raw, start)
            right = crc & 0xFF == wire.CRC_RESIDUE & 0xFF
            return wire.CRC_RESIDUE if right else crc

    splitter_zlib = Weak()
    monkeypatch.setattr(line, "RATE", 1e-2)
    rng = np.random.default_rng(1)
    sent = itertools.count()

    class Source:
        def piece(self):
            return b"".join(
                wire.frame(
                    bytes([wire.SAMPLE, k & 0xFF])
                    + k.to_bytes(4, "little")
                    + rng.integers(1, 255, 16, np.uint8).tobytes()
                )
                for k in itertools.islice(sent, 2000)
            )

        def healthy(self):
            return True

    monkeypatch.setattr(line, "_Source", Source)
    good = line._samples(20000, np.random.default_rng(2), None)
    assert good["wrong"] == 0
    monkeypatch.setattr(wire, "zlib", splitter_zlib)
    bad = line._samples(20000, np.random.default_rng(2), None)
    assert bad["wrong"] > 0
    found = line.failures({"samples": bad, "checks": [], "requests": []})
    assert any("wrong samples" in text for text in found)
