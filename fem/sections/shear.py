"""Shear coefficients of sections.

Those of Cowper, *The shear coefficient in Timoshenko's beam theory*, J. Appl. Mech. 33 (1966) 335-340, where
he has the shape, at Poisson's ratio ``nu``; those of rectangles are Hutchinson's, which depend on the ratio
of the sides. At nu = 0, the default, they are the values of least energy as well. Other shapes have the
energy's value for thin walls (`fem.sections.walls`), which does not depend on nu. Walls are counted along
their centre lines, and fillets not: this makes k too small, by 1 to 3 % for walls of a twentieth of the
height, by 5 to 8 % for a tenth, by up to 17 % in rolled profiles with large fillets.
"""

import numpy as np

from fem.sections.constants import LARGEST_SHEAR_COEFFICIENT


def shear_coefficient_of_rectangle(b: float, h: float, nu: float) -> float:
    """Return k of a rectangle for vibration with shear along its height h, and b across [-].

    That of Hutchinson, *J. Appl. Mech.* 68 (2001) 87-92, and of Stephen and Levinson, *J. Sound Vib.* 67
    (1979) 293-305, which are the same. Upright it is 5 (1 + ν) / (6 + 5 ν). The width of a flat bar bends
    crosswise, which stiffens it: 1.096 for b = 3h at ν = 0.3. Where 1/k falls below zero (b above 5.3 h at
    ν = 0.3, 7.1 h at 0.2) no Timoshenko beam has that flexibility, and 0 is returned, which leaves shear out.

    Cowper's 10 (1 + ν) / (12 + 11 ν), of a cantilever loaded at its tip, does not depend on the
    width. All are 5/6 at ν = 0.
    """
    flexibility = shear_flexibility_of_rectangle(b, h, nu)
    return 1 / flexibility if flexibility > 1 / LARGEST_SHEAR_COEFFICIENT else 0.0


def shear_flexibility_of_rectangle(b: float, h: float, nu: float) -> float:
    """Return 1/k of a rectangle with shear along h: exact to the first order in (section / wave length)².

    Hutchinson, *J. Appl. Mech.* 68 (2001) 87-92, (46) and (47). Much wider than high it becomes
    -(ν/(1 + ν))² (b/h)², a strip of a thin plate.
    """
    a, c = h / 2, b / 2
    n = np.pi * np.arange(1, 2000)
    bent = float(((n * a - c * np.tanh(n * a / c)) / n**5).sum())
    C4 = (
        4 / 45 * a**3 * c * (-12 * a**2 - 15 * nu * a**2 + 5 * nu * c**2)
        + 16 * nu**2 * c**5 / (1 + nu) * bent
    )
    return -(9 / (4 * a**5 * c) * C4 + nu * (1 - (c / a) ** 2)) / (2 * (1 + nu))


def cowper_rectangle(nu: float) -> float:
    """Return k of a rectangle of any sides (Cowper 1966)."""
    return 10 * (1 + nu) / (12 + 11 * nu)


def cowper_tube(m: float, nu: float) -> float:
    """Return k of a tube with m = inner / outer diameter, 0 for a full circle (Cowper 1966)."""
    s = (1 + m**2) ** 2
    return 6 * (1 + nu) * s / ((7 + 6 * nu) * s + (20 + 12 * nu) * m**2)


def cowper_box(b: float, h: float, nu: float) -> float:
    """Return k of a box with walls of one thickness, for shear along its height h (Cowper 1966)."""
    m, n = b / h, b / h  # the walls are equally thick
    below = 12 + 72 * m + 150 * m**2 + 90 * m**3 + nu * (11 + 66 * m + 135 * m**2 + 90 * m**3)
    return 10 * (1 + nu) * (1 + 3 * m) ** 2 / (below + 10 * n**2 * ((3 + nu) * m + 3 * m**2))
