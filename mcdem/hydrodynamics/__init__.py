"""How spheres feel each other through the fluid.

far_field    grand mobility of N spheres, forces, torques and stresslets
two_sphere   exact resistance of two spheres, its far field, and the table of their difference
             (twin_multipoles: the exact series; pair_mobility: the far field; pair_tensors: scalars to tensors)
lubrication  the two-body part laid into the resistance of N spheres
stokesian    the whole: resistance, drive of the straining flow, velocities; the coarser levels, which leave out parts of it
lagged       the far field of a while ago, turned along and corrected
matrix_free  the same velocities for many spheres, by iteration in O(N) memory
mobility_product  the grand mobility applied pair by pair, for both of these
"""
