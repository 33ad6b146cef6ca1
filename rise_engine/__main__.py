"""Runs `rise-engine` as `python -m rise_engine`."""

from rise_engine.cli import main

main(prog_name="rise-engine")
