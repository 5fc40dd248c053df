"""Programs that answer the open test: each file has SOURCE and ``solve(case) -> Said``."""

NAMES = (
    "nothing", "do_not_know", "modal_updating", "sparse_bayes", "constitutive_error", "frf_one_by_one",
    "forward_modal", "dovetail_default", "dovetail_quick", "dovetail_modes",
)  # fmt: skip
