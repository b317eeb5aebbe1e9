"""Tables of encounters: the hand-over between simulation and balance."""
