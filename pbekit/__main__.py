"""`python -m pbekit`."""

from pbekit.commands.main import main

if __name__ == "__main__":
    main()
