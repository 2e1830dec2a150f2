import pytest
import shared_objects


@pytest.fixture(scope="session", autouse=True)
def shared(tmp_path_factory):
    """All processes of this run share one folder."""
    place = tmp_path_factory.getbasetemp()
    kept = (place.parent if place.name.startswith("popen-") else place) / "objects"
    kept.mkdir(exist_ok=True)
    with pytest.MonkeyPatch.context() as patch:
        shared_objects.by_objects(patch, kept)
        yield
