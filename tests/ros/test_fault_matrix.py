"""The matrix of faults, which `./dev soak --robots` plays whole: here, only that it runs with the engine as it is.

What it finds depends on the machine's speed, so a busy one is not judged by it.
"""

from __future__ import annotations

import pytest

from tests.ros.contract.peers import environment, missing

pytestmark = [
    pytest.mark.dds,
    pytest.mark.slow,
    pytest.mark.skipif(bool(missing("dds")), reason=missing("dds") or "there is no reason"),
]


async def test_a_stopped_engine_is_killed_and_another_one_continues(monkeypatch: pytest.MonkeyPatch) -> None:
    from tests.ros import fault_matrix

    monkeypatch.setattr(fault_matrix, "AFTER", 0.5)
    for name, value in environment().items():
        monkeypatch.setenv(name, value)
    assert isinstance(await fault_matrix.play("speaks", "kill_the_stopped_engine", "dds", "dds"), list)
