"""The command `pbekit`, also as `python -m pbekit`: ready to be interrupted before anything else is loaded."""

from pbekit import endings


def _command() -> None:
    from pbekit.commands.main import app

    app(prog_name="pbekit")


def main() -> None:
    """Entry point of the console script."""
    endings.program(_command)


if __name__ == "__main__":
    main()
