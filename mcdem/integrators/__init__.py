"""How an encounter is followed in time; one scheme is chosen.

implicit     linearly implicit midpoint steps (default)
paper_euler  the paper's explicit Euler with Eq. 20
integrate    the loop over steps, whichever scheme advances them
bodies, contacts, state   what both stand on
"""
