"""Two equal spheres moving along, or turning about, their line of centres: closed series in bispherical coordinates."""

from __future__ import annotations

import mpmath


def drag_along_the_line(gap: float) -> tuple[float, float]:
    """Stokes factors of two equal spheres in opposite and in the same motion.

    Brenner, Chem. Eng. Sci. 16 (1961) 242 (a free surface stands for the other sphere), and Stimson & Jeffery, Proc. R.
    Soc. A 111 (1926) 110.
    """
    with mpmath.workdps(40):
        alpha = mpmath.acosh(1 + mpmath.mpf(gap) / 2)
        opposite = same = mpmath.mpf(0)
        for n in range(1, int(22 / alpha) + 40):
            h = 2 * n + 1
            weight = mpmath.mpf(n * (n + 1)) / ((2 * n - 1) * (2 * n + 3))
            odd = 4 * mpmath.cosh(h * alpha / 2) ** 2 + h**2 * mpmath.sinh(alpha) ** 2
            even = 4 * mpmath.sinh(h * alpha / 2) ** 2 - h**2 * mpmath.sinh(alpha) ** 2
            opposite += weight * (odd / (2 * mpmath.sinh(h * alpha) - h * mpmath.sinh(2 * alpha)) - 1)
            same += weight * (1 - even / (2 * mpmath.sinh(h * alpha) + h * mpmath.sinh(2 * alpha)))
        factor = 4 * mpmath.sinh(alpha) / 3
        return float(factor * opposite), float(factor * same)


def torque_about_the_line(gap: float) -> tuple[float, float]:
    """Torque over 8 pi mu a^3 omega of two equal spheres in opposite and in the same rotation about their line.

    The images of a sphere of radius a at the centre of the other shrink as sinh(alpha)/sinh(m alpha), cosh(alpha) = r/2a, and a
    rotlet goes with the cube of the radius; at contact the sums are zeta(3) and (3/4) zeta(3) (Jeffery, Proc. Lond. Math. Soc.
    14 (1915) 327).
    """
    with mpmath.workdps(30):
        alpha = mpmath.acosh(1 + mpmath.mpf(gap) / 2)
        opposite = same = mpmath.mpf(0)
        for m in range(1, 200_000):
            term = (mpmath.sinh(alpha) / mpmath.sinh(m * alpha)) ** 3
            opposite += term
            same += -term if m % 2 == 0 else term
            if term < 1e-13:
                break
        return float(opposite), float(same)
