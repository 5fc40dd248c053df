"""Shape and colour of the marker of each kind of effect."""

from viz import style

MARKERS = {
    "support": ("^", style.SUPPORT),
    "support_flexibility": ("v", style.SUPPORT),
    "joint": ("D", style.JOINT),
    "joint_stiffness": ("D", style.PURPLE),
    "joint_viscous_damping": ("h", style.PURPLE),
    "joint_structural_damping": ("H", style.PURPLE),
    "added_mass": ("o", style.GREEN),
    "point_mass": ("o", style.GREEN),
    "member_density": ("s", style.GREEN),
    "member_stiffness": ("s", style.ORANGE),
    "stiffness_loss": ("X", style.VERMILION),
    "preload": ("P", style.SKY),
    "crack": ("X", style.ORANGE),
    "end_release": ("d", style.ORANGE),
    "rigid_end_zone": ("d", style.SKY),
    "solid_corner": ("s", style.PURPLE),
    "joint_patch": ("s", style.SKY),
    "member_section": ("s", style.SKY),
    "ground_spring": ("v", style.GREEN),
    "foundation": ("v", style.VERMILION),
    "foundation_dashpot": ("v", style.PURPLE),
    "joint_mass": ("D", style.GREEN),
    "joint_zener": ("D", style.SKY),
    "joint_fractional": ("D", style.VERMILION),
    "joint_offset": ("D", style.ORANGE),
    "distributed_mass": ("8", style.GREEN),
    "fluid_added_mass": ("8", style.SKY),
    "sensor_mass": (".", style.GREEN),
    "driver_mass": ("*", style.GREEN),
    "stinger": ("*", style.PURPLE),
}
"""Markers by kind of effect; other kinds get one of `OTHER_MARKERS`."""

OTHER_MARKERS = ("p", "*", "<", ">", "d", "8")
