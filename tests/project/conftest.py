import pytest
from pages import Terminals


@pytest.fixture
def terminals(tmp_path):
    opened = Terminals(tmp_path)
    yield opened
    opened.close()
