"""What holds for every property test of this project."""

from __future__ import annotations

import re
from pathlib import Path

from hypothesis import HealthCheck, settings

from tests import chance

TESTS = Path(__file__).parent


def test_no_property_test_depends_on_chance_or_on_speed() -> None:
    usual = settings()
    assert usual.derandomize != bool(chance.SEARCH) and usual.database is None
    assert usual.deadline is None
    assert HealthCheck.too_slow in usual.suppress_health_check


def test_no_test_has_a_rule_of_its_own_about_speed() -> None:
    """The profile of conftest.py is the one place. Whoever suppresses another check keeps what it suppresses."""
    for file in sorted(TESTS.rglob("*.py")):
        if file.name in ("conftest.py", Path(__file__).name):
            continue
        text = file.read_text(encoding="utf-8")
        if "from hypothesis import" not in text:
            continue
        for settings_ in re.findall(r"\bsettings\((?:[^()]|\([^()]*\))*\)", text):
            assert "deadline" not in settings_, (file, settings_)
            assert not re.search(r"max_examples=\d", settings_), (file, settings_)
            assert "suppress_health_check=[Health" not in settings_, (file, settings_)
