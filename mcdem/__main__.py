"""`python -m mcdem` is the command `mcdem`."""

from mcdem.commands.main import main

if __name__ == "__main__":
    main()
