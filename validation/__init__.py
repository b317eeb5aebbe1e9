"""Claims about the toolkit, each with its source, its tolerance, what was measured, and a verdict.

    python -m validation --quick -o report/

A claim is one file of `validation/cases/`; `case.py` says what it holds.
"""
