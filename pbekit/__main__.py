"""`python -m pbekit`."""

from pbekit.cli import main

if __name__ == "__main__":
    main()
