"""The subcommands of pbekit."""
