"""What a test could show: the missing masses and soft supports that it would see, before it is made.

At a support the picture has the direction of which the test shows least.
"""

import tempfile
from pathlib import Path

from dovetail import load_study
from viz import render_plan

study = load_study(Path(__file__).parent / "first-frame" / "study.toml")
kinds = ("support_flexibility", "point_mass")  # all kinds take some seconds
found = study.plan(noise=0.01, left_db=0.1, kinds=kinds)

picture = render_plan(found.plan, Path(tempfile.mkdtemp()) / "map.png", "First frame")
print(f"picture in {picture}")
for row in found.rows:
    print(f"{row.kind}: the smallest one seen has a {row.smallest}")

# The effect that the tutorial hides and finds: the left foot turns about y.
hidden = next(o for o in found.plan.relevant if o.relevant.name == "support_flexibility:left foot.ry")
share = found.coverage("seen")
print(f"{100 * share:.0f} % of the effects are seen, the soft foot of the tutorial among them")

assert hidden.seen
assert 0.1 < share < 1.0
