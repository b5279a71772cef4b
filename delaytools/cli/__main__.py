"""`python -m delaytools.cli`: the same as the command `delaytools`."""

from delaytools.cli.main import run

if __name__ == "__main__":
    run()
