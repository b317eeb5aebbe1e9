"""`python -m mcdem` is the command `mcdem`."""

from mcdem.cli import main

if __name__ == "__main__":
    main()
