"""The runs of the figures' tests."""

import pytest

from hexatorque.evidence.papers.engine.job import Job


@pytest.fixture(scope="module")
def job(tmp_path_factory):
    return Job(True, tmp_path_factory.mktemp("points"))
