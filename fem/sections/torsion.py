"""Torsion constants of the walls, junctions and corners of open sections.

St Venant's torsion: open sections are stiffer near ends that cannot warp than by J alone.
"""

import numpy as np

END_LOSS = 0.105
"""Loss of a wall's free end on b t³/3, in t⁴: half of 0.630/3 (Timoshenko & Goodier, art. 109)."""

CROSSING = 0.68
"""Gain of J by the crossing of two plates, in t⁴: from finite elements, see the tests."""


def t_junction(b: float, tf: float, tw: float, r: float = 0.0) -> float:
    """Return the torsion constant of a flange and its junction with a web [m⁴].

    b tf³/3 - 0.21 tf⁴ + α D⁴ with the inscribed circle D = ((tf + r)² + (r + tw/4) tw) / (2r + tf) and

        α = -0.042 + 0.2204 tw/tf + 0.1355 r/tf - 0.0865 r tw/tf² - 0.0725 (tw/tf)²

    El Darwish & Johnston, *Torsion of structural shapes*, J. Struct. Div. ASCE 91 ST1 (1965) 203-227, as
    steel tables have it. Within 0.6 % of finite elements for a T with tw/tf from 0.3 to 1.4 and b/tf = 10.
    Webs more than twice as thick as the flange are taken as walls that run through it.
    """
    if tw > 2 * tf:
        return (b - tw) * tf**3 / 3 + tf * tw**3 / 3 - 2 * END_LOSS * tf**4 - END_LOSS * tw**4
    q, p = tw / tf, r / tf
    D = ((tf + r) ** 2 + (r + tw / 4) * tw) / (2 * r + tf)
    alpha = -0.042 + 0.2204 * q + 0.1355 * p - 0.0865 * p * q - 0.0725 * q**2
    return b * tf**3 / 3 - 2 * END_LOSS * tf**4 + alpha * D**4


def corner(b: float, tf: float, tw: float, r: float = 0.0) -> float:
    """Return the torsion constant of a flange up to its corner with a web, less the corner's share [m⁴].

    b tf³/3 - 0.105 tf⁴ + α D⁴ for a flange not thinner than the web, with the inscribed circle
    D = 2 (3r + tw + tf - √(2 (2r + tw)(2r + tf))) and, q = tw/tf,

        α = -0.0908 + 0.2621 q + 0.1231 r/tf - 0.0752 q r/tf - 0.0945 q²

    (El Darwish & Johnston 1965); the other way round, the web runs through. Free ends are left to the caller.
    """
    thick, thin = max(tf, tw), min(tf, tw)
    q, p = thin / thick, r / thick
    D = 2 * (3 * r + tw + tf - np.sqrt(2 * (2 * r + tw) * (2 * r + tf)))
    alpha = -0.0908 + 0.2621 * q + 0.1231 * p - 0.0752 * p * q - 0.0945 * q**2
    walls = b * tf**3 / 3 if tf >= tw else (b - tw) * tf**3 / 3 + tf * tw**3 / 3
    return float(walls - END_LOSS * thick**4 + alpha * D**4)
