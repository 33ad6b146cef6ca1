"""`python -m rise_engine` is `rise-engine`."""

from rise_engine.cli import main

main(prog_name="rise-engine")
