"""Names of the files of a part that has one for each matrix.

They are named after one path: ``part.mtx`` stands for ``part.K.mtx`` and ``part.M.mtx``, and so do
``job_STIF2.mtx`` and ``job_MASS2.mtx`` of Abaqus.
"""

import re
from pathlib import Path

from fem.matrices import MatricesError

_WORDS = {
    "K": ("K", "STIF", "STIFF", "STIFFNESS"),
    "M": ("M", "MASS"),
    "C": ("C", "DMPV", "DAMP", "DAMPING"),
    "D": ("D", "DMPS"),
    "Q": ("Q",),
}
"""Words at the end of a file's name that say which matrix it has."""
_KEY_OF = {word: key for key, words in _WORDS.items() for word in words}


def matrix_files(path: Path) -> tuple[str, dict[str, Path]]:
    """Return the name that the files of a part share, and the file of each matrix.

    Raises
    ------
    MatricesError
        If two files could have the same matrix.
    """
    words, base, number = "|".join(_KEY_OF), path.stem, r"\d*"
    given = re.fullmatch(rf"(.+?)[._-]({words})(\d*)", path.stem, re.IGNORECASE) if path.is_file() else None
    if given:
        base, number = given[1], given[3]
    pattern = re.compile(rf"{re.escape(base)}[._-]({words}){number}", re.IGNORECASE)
    found: dict[str, Path] = {}
    for file in sorted(path.parent.iterdir()) if path.parent.is_dir() else ():
        match = pattern.fullmatch(file.stem) if file.suffix.lower() == path.suffix.lower() else None
        if match:
            key = _KEY_OF[match[1].upper()]
            if key in found:
                msg = f"{found[key].name} and {file.name} could both be {key}; name the file of K"
                raise MatricesError(msg)
            found[key] = file
    return base, found
