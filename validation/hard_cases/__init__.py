"""Hard cases: what breaks codes of this kind, each with what a user would do to meet it, checked against stated laws.

    python -m validation.hard_cases                 the whole catalogue
    python -m validation.hard_cases --quick         what takes seconds
    python -m validation.hard_cases NAME...         some of it
    python -m validation.hard_cases --readme        the whole, and README.md made of it

`catalogue` lists the cases as data, `laws` holds one function a law, `case` brings them together, `table` says what came of it.
"""
