"""A fingerprint of the program, by which workers on other machines are known to run the same."""

import hashlib
from functools import lru_cache
from importlib import metadata
from pathlib import Path

PACKAGES = ("fem", "updating", "joint", "viz", "dovetail")
NUMERICS = ("numpy", "scipy")


@lru_cache(maxsize=1)
def fingerprint() -> str:
    """Return a short hash of the program's code and of the versions of NumPy and SciPy."""
    digest = hashlib.sha256()
    root = Path(__file__).parents[2]
    for package in PACKAGES:
        for file in sorted((root / package).rglob("*.py")):
            digest.update(file.relative_to(root).as_posix().encode())
            digest.update(file.read_bytes())
    for name in NUMERICS:
        digest.update(f"{name} {metadata.version(name)}".encode())
    return digest.hexdigest()[:12]
