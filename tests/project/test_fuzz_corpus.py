"""The fuzz targets' packed inputs: unpacking and packing leaves the files as they are."""

from pathlib import Path

import fuzz_corpus
import pytest

CORPUS = Path(__file__).resolve().parents[2] / "tests/c/fuzz/corpus"


@pytest.mark.parametrize("name", ["packet", "service", "xcp"])
def test_a_packed_corpus_comes_back_the_same(name, tmp_path):
    packed, folder = CORPUS / f"{name}.hex", tmp_path / "inputs"
    inputs = fuzz_corpus.unpack(packed, folder)
    assert inputs == len(list(folder.iterdir())) > 100
    assert fuzz_corpus.pack(folder, tmp_path / "again.hex") == inputs
    assert (tmp_path / "again.hex").read_text() == packed.read_text()


def test_wrong_arguments_show_how_to_call_it(capsys):
    assert fuzz_corpus.main(["unpack"]) == 2
    assert "pack FOLDER" in capsys.readouterr().err
