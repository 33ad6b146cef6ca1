"""The examples in docstrings of the kernel and the sessions do what they say."""

from __future__ import annotations

import doctest
from importlib import import_module

import pytest


@pytest.mark.parametrize(
    "module", ["rise_engine.kernel.kernel", "rise_engine.session.reading", "rise_engine.session.export"]
)
def test_examples_run(module: str) -> None:
    failed, tried = doctest.testmod(import_module(module))
    assert tried and not failed
