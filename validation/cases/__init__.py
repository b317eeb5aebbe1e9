"""The claims, one a file; a file's name is its case's name.  It defines `CASE`, a `validation.case.Case`."""
