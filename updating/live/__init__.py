"""Hypotheses changed by hand: FRFs and errors at once, fits that can be watched and cancelled."""
