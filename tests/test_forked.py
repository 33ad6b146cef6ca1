"""Processes that tests start as forks."""

from concurrent.futures import ThreadPoolExecutor

from tests.forked import run_engine


def test_several_threads_may_start_processes_at_once() -> None:
    """Their requests were mixed, and the process that the others are forks of ended: 45 tests failed after it."""
    with ThreadPoolExecutor(16) as threads:
        ended = threads.map(lambda number: run_engine(code=f"print({number})"), range(64))
        assert [int(each.stdout) for each in ended] == [*range(64)]
