"""Print what times depend on: commit, processor, versions, and whether OpenBLAS knows the processor."""

import platform
import subprocess
import sys
from pathlib import Path

import numpy as np
import scipy
import scipy.linalg  # loads the OpenBLAS of SciPy
from threadpoolctl import threadpool_info

NEWEST = {"avx512f": {"SkylakeX", "Cooperlake", "SapphireRapids"}, "avx2": {"Haswell", "Zen"}}
"""Kernels of OpenBLAS that use an instruction set, the newest set first."""


def processor() -> tuple[str, set[str]]:
    """Return name and instruction sets; none where the system does not tell them."""
    try:
        text = Path("/proc/cpuinfo").read_text(encoding="utf-8")
    except OSError:
        return platform.processor(), set()
    keys = dict(line.split(":", 1) for line in text.splitlines() if ":" in line)
    known = {key.strip(): value.strip() for key, value in keys.items()}
    return known.get("model name", platform.processor()), set(known.get("flags", "").split())


def kernels(flags: set[str]) -> list[str]:
    """Return which kernels each OpenBLAS uses, and what it does not know of the processor."""
    best = next((name for name in NEWEST if name in flags), None)
    out = []
    for library in threadpool_info():
        if library["internal_api"] != "openblas":
            continue
        kernel = library["architecture"]
        old = best is not None and kernel not in NEWEST[best]
        note = f": of an older processor, as this one has {best}; times are too long" if old else ""
        out.append(f"OpenBLAS {library['version']}, {library['num_threads']} threads, kernels {kernel}{note}")
    return sorted(set(out))


def main() -> None:
    """Print a line for each."""
    asked = subprocess.run(
        ["git", "describe", "--always", "--dirty"], capture_output=True, text=True, check=False
    )
    name, flags = processor()
    print(f"commit {asked.stdout.strip() or 'unknown'}, Python {sys.version.split()[0]}, ", end="")
    print(f"NumPy {np.__version__}, SciPy {scipy.__version__}")
    print(name, *kernels(flags), sep="\n")


if __name__ == "__main__":
    main()
