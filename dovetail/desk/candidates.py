"""The page's candidates: a tree by place and kind, their ranking, and the results of a diagnosis."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import numpy as np
from nicegui import ui

from dovetail.desk.session import Desk
from dovetail.desk.widgets import Act, button, card, choice, labelled
from dovetail.report.probable import hypotheses, probability_details, probability_text
from dovetail.report.words import (
    departure_text,
    effect_label,
    fault_text,
    parameters_text,
    place,
    ranked_label,
)
from fem.declarations import Environment
from fem.model import parameter_values
from fem.summary import percent
from updating.diagnosis.candidates import unstated
from updating.live.ranking import Promise, RankedCandidates

N_RANKED = 8
"""Best candidates that are listed [-]."""

HEADER = """
<div class="row items-center no-wrap full-width">
  <div class="col">{{ props.node.label }}</div>
  <q-btn v-if="props.node.add" flat dense round size="sm" icon="add" :aria-label="'Add ' + props.node.id"
    :disable="props.node.added" @click.stop="props.tree.$emit('add', props.node.id)" />
</div>
"""


class CandidateList:
    """Candidates of the chosen spot, or of all.

    Parameters
    ----------
    desk : Desk
    act : callable
    rank : callable
        Ranks all candidates.
    chosen : callable
        Called when another spot is chosen.
    """

    def __init__(
        self,
        desk: Desk,
        act: Act,
        rank: Callable[[], None],
        chosen: Callable[[], None],
    ) -> None:
        self._desk, self._act, self._chosen = desk, act, chosen
        self.spot = ""
        with card("Candidates"):
            with ui.element("div").classes("desk-row"):
                spots = {"": "everywhere", **{name: name for name in desk.spots}}
                self._choice = choice("Place", spots, "", self._choose, width=180, typed=True)
                button("Rank", rank, "sort", label="Rank candidates")
            self._found = ui.element("div").classes("desk-lines")
            self._best = ui.element("div").classes("desk-lines")
            with ui.element("div").classes("desk-list"):
                self._tree = ui.tree([], node_key="id", label_key="label")
                labelled(self._tree, "candidates by place and kind")
                self._tree.add_slot("default-header", HEADER)
                self._tree.on("add", lambda e: self._add(e.args))
        self._shown: Any = None
        self.refresh()

    def choose(self, spot: str) -> None:
        """List the candidates of a spot; of all if it is empty."""
        self._choice.set_value(spot)

    def _choose(self, spot: str) -> None:
        self.spot = spot
        self.refresh()
        self._chosen()

    def refresh(self) -> None:
        """Show the candidates of the chosen spot, their ranking, and the diagnosis."""
        self._fill_tree()
        self._best.clear()
        with self._best:
            self._ranking()
        self._found.clear()
        with self._found:
            self._diagnosis()

    def _take_over(self) -> None:
        def take() -> None:
            if left := self._desk.take_over():
                ui.notify(f"Not on the desk, as it cannot show them: {', '.join(left)}", multi_line=True)

        self._act(take)

    def _add(self, name: str, **values: float) -> None:
        self._act(lambda: self._desk.add(name, **values))

    def _names(self) -> tuple[str, ...]:
        """Return the candidates of the chosen spot, or all."""
        spots = self._desk.spots
        chosen = [spots[self.spot]] if self.spot else list(spots.values())
        return tuple(name for spot in chosen for names in spot.places.values() for name in names)

    def _fill_tree(self) -> None:
        desk, spot = self._desk, self.spot
        added = {e.name for e in desk.now.hypothesis.effects}
        now = (spot, frozenset(added))
        if now == self._shown:
            return
        self._shown = now
        spots = [desk.spots[spot]] if spot else list(desk.spots.values())
        # Candidates that the tree holds at most; of more, those of one spot [-]
        whole = bool(spot) or len(desk.candidates) <= 600
        missing = unstated(desk.study.model)
        nodes = []
        for one in spots:
            for where, names in one.places.items():
                kinds: dict[str, list[str]] = {}
                for name in names if whole else ():
                    kinds.setdefault(desk.candidates[name].kind, []).append(name)
                children = [self._kind_node(where, k, n, added, missing) for k, n in sorted(kinds.items())]
                label = f"{where} ({len(names)})"
                nodes.append({"id": f"place {where}", "label": label, "children": children})
        self._tree.props["nodes"] = nodes
        self._tree.update()
        if spot:
            self._tree.expand([n["id"] for n in nodes] + [k["id"] for n in nodes for k in n["children"]])

    def _kind_node(
        self,
        where: str,
        kind: str,
        names: list[str],
        added: set[str],
        missing: Mapping[Environment, list[str]],
    ) -> dict[str, Any]:
        leaves = [
            {"id": name, "label": self._leaf(name), "add": True, "added": name in added} for name in names
        ]
        needed = (e for e, kinds in missing.items() if kind in kinds)
        label = " – ".join([kind.replace("_", " "), *(f"{e} is not stated" for e in needed)])
        return {"id": f"{where} {kind}", "label": label, "children": leaves}

    def _leaf(self, name: str) -> str:
        effect = self._desk.candidates[name]
        parameters = ", ".join(
            p.name.replace("_", " ") + ("" if p.unit == "-" else f" [{p.unit}]") for p in effect.parameters()
        )
        return f"{place(effect.where)} – {parameters}"

    def _ranking(self) -> None:
        desk, ranking = self._desk, self._desk.ranking
        names = set(self._names())
        best = [p for p in ranking.promises if p.effect.name in names][:N_RANKED]
        if not best:
            return
        old = desk.ranked_beside is not desk.now.hypothesis
        ui.label(ranking_text(ranking, old=old)).classes("desk-note")
        for promise in best:
            effect = promise.effect
            with ui.element("div").classes("desk-row"):
                ui.label(gain_text(promise)).style("width: 84px")
                if not ranking.far:
                    ui.label(percent(promise.probability)).style("width: 64px")
                values = parameters_text(promise.parameters)
                label = f"{effect_label(effect.kind, effect.where)}: {values}"
                ui.label(label).style("flex: 1; min-width: 0")
                add = partial(self._add, effect.name, **parameter_values(effect))
                button("", add, "add", label=f"Add {effect.name} as ranked")
        if not ranking.far:
            others = (
                f"nothing more {percent(ranking.nothing)}, no single candidate {percent(ranking.unknown)}"
            )
            ui.label(f"Probability of the other answers: {others}.").classes("desk-note")

    def _diagnosis(self) -> None:
        desk = self._desk
        d = desk.diagnosis
        if d is None:
            return
        with ui.element("div").classes("desk-row"):
            ui.label(f"Diagnosis: {d.verdict}").classes("desk-name")
            ui.space()
            if d.findings or d.faults:
                button("Take over", self._take_over, "done_all")
        ui.label(d.reason).classes("desk-note")
        last = d.steps[-1]
        ui.label(
            f"It leaves {last.fit_db:.2f} dB on the lines of the fit, "
            f"{last.held_out_db:.2f} dB on held-out lines"
        ).classes("desk-note")
        for differs in d.departures:
            ui.label(f"Form: {departure_text(differs)}.").classes("desk-note")
        for fault in d.every_fault:
            ui.label(f"{fault_text(fault)}.").classes("desk-note")
        for sure in filter(None, (probability_text(d), probability_details(d))):
            ui.label(sure).classes("desk-note")
        for hypothesis, probability in hypotheses(d)[:N_RANKED]:
            ui.label(f"{percent(probability)}: {hypothesis}").classes("desk-note")
        for ranked in (r for round_ in d.rounds[:1] for r in round_[:N_RANKED]):
            with ui.element("div").classes("desk-row"):
                ui.label(f"{ranked.fit_db:.2f} dB").style("width: 64px")
                words = f"{ranked_label(ranked)}: {parameters_text(ranked.parameters)}"
                ui.label(words).style("flex: 1; min-width: 0")
                if ranked.name in desk.candidates:
                    add = partial(self._add, ranked.name, **{p.name: p.value for p in ranked.parameters})
                    button("", add, "add", label=f"Add {ranked.name} as diagnosed")


def ranking_text(ranking: RankedCandidates, *, old: bool) -> str:
    """Return what the numbers of a ranking mean."""
    when = " for an earlier hypothesis (rank again for the present one)" if old else ""
    if ranking.far:
        return (
            f"Gain of each candidate{when}. The hypothesis is far from the data: gains order the "
            "candidates, and fits decide."
        )
    return f"Gain of each candidate{when}, and its probability; all that is uncertain follows:"


def gain_text(promise: Promise) -> str:
    """Return what a candidate gains, in nats."""
    return f"{promise.gain:.1f} nats" if np.isfinite(promise.gain) else "not seen"
