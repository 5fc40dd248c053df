"""Words and JSON fields of static responses to several load cases."""

from typing import Any

import numpy as np

from fem.analysis.static_cases import StaticCases

STRESSES = {
    "low": "least normal stress",
    "high": "largest normal stress",
    "shear": "largest shear stress",
    "von_mises": "largest von Mises stress",
}
"""Stresses of sections by their names in results."""

NO_BUCKLING = "the structure does not buckle under this load, however large"
"""Why a load case has no buckling factor."""


def factor_fields(found: StaticCases) -> dict[str, Any]:
    """Return the buckling factors and the slack bars for JSON, where there may be some.

    A case without a factor has the reason.
    """
    if found.slack:
        return {"slack_members": {name: list(members) for name, members in found.slack.items()}}
    if not found.factors:
        return {}
    endless = [name for name, factor in found.factors.items() if not np.isfinite(factor)]
    missing = {"buckling_factors_missing": dict.fromkeys(endless, NO_BUCKLING)} if endless else {}
    return {"second_order": True, "buckling_factors": dict(found.factors)} | missing


def factor_words(found: StaticCases, name: str) -> str:
    """Return the words behind a load case on its buckling factor, or on slack bars."""
    if found.slack.get(name):
        return f"; slack: {', '.join(found.slack[name])}"
    if name not in found.factors:
        return ""
    factor = found.factors[name]
    limit = f"buckles at {factor:.4g} times the load" if np.isfinite(factor) else "does not buckle"
    return f"; second order, {limit}"
