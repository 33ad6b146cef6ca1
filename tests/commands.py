"""`rise-engine`, typed in this process."""

from click.testing import CliRunner, Result

from rise_engine.cli import main


def typed(*words: object, input: str | None = None) -> Result:
    """What comes of a command. `input`: what is typed while it runs."""
    return CliRunner().invoke(main, [str(each) for each in words], input=input)


def run(*words: object, status: int = 0) -> str:
    """What a command says, whose exit status is this one."""
    done = typed(*words)
    assert done.exit_code == status, done.output
    return done.output
