"""What was found, as lines of text: on the command line, and where a diagnosis is printed in Python."""

from dovetail.report import words
from dovetail.report.probable import probability_details, probability_text
from dovetail.result import uncertain_parameters
from updating.diagnosis.verdict import Verdict


def found_lines(d: Verdict) -> list[str]:
    """Return found effects with values, twins and probability, doubts, and sensor faults, a line each."""
    out = []
    for k, f in enumerate(d.findings):
        out.append(f"  {words.finding_text(f)}")
        out += [f"    {text}" for text in (words.compliance_text(f),) if text]
        out += [f"    {spot}" for spot in (words.spot_text(f.effect, d.model),) if spot]
        if f.alternatives:
            names = "; ".join(map(words.ranked_label, f.alternatives))
            out.append(f"    cannot be distinguished from: {names}")
        out += [f"    {words.extension_text(f, t)}" for t in f.extensions]
        if k < len(d.rounds) and (equal := words.equal_fit_text(d, f, d.rounds[k])):
            out.append(f"    {equal}")
    out += [f"    {text}" for text in (words.images_text(d),) if text]
    out += [f"  {text}" for text in (probability_text(d),) if text]
    out += [f"    {text}" for text in (probability_details(d),) if text]
    out += [f"  {text}" for text in (words.far_text(uncertain_parameters(d)),) if text]
    out += [f"  Form: {words.departure_text(f)}" for f in d.departures]
    return out + [f"  {words.fault_text(f)}" for f in d.every_fault]
