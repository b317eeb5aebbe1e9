"""The command `mcdem`, also as `python -m mcdem`: ready to be interrupted before anything else is loaded."""

from pbekit import endings


def _command() -> None:
    from mcdem.commands.main import app

    app(prog_name="mcdem")


def main() -> None:
    """Entry point of the console script."""
    endings.program(_command)


if __name__ == "__main__":
    main()
