"""What a test could show: the missing masses and soft supports that it would see, before it is made."""

import tempfile
from dataclasses import replace
from pathlib import Path

from dovetail import load_study
from fem.effects import candidate_kinds
from viz.plan import render_plan

study = load_study(Path(__file__).parent / "first-frame" / "study.toml")
others = set(candidate_kinds()) - {"support_flexibility", "point_mass"}  # all kinds take some seconds
found = replace(study, exclude=tuple(others)).plan(noise=0.01, left_db=0.1)

picture = render_plan(found.plan, Path(tempfile.mkdtemp()) / "map.png", "First frame")
print(f"picture in {picture}")
for row in found.rows:
    print(f"{row.kind}: seen from a {row.smallest} on")

# The effect that the tutorial hides and finds: the left foot turns about y.
hidden = next(o for o in found.plan.relevant if o.relevant.name == "support_flexibility:left foot.ry")
share = found.coverage("seen")
print(f"{100 * share:.0f} % of the effects are seen, the soft foot of the tutorial among them")

assert hidden.seen
assert 0.1 < share < 1.0
