"""Fresh cases whose truth no beam code of Dovetail made; README.md says how they are drawn."""
