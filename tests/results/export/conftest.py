"""What tests of several formats read."""

from __future__ import annotations

import pytest

from rise_engine.results.analysis.model import SessionData
from rise_engine.results.analysis.reading import read_session
from tests.results.analysis.samples import play_session


@pytest.fixture(scope="session")
def real(tmp_path_factory: pytest.TempPathFactory) -> SessionData:
    """A session of everything, as an engine has recorded it."""
    return read_session(play_session(tmp_path_factory.mktemp("lab")))
