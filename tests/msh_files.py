"""A writer of small Gmsh files in every form that there is, for tests: the same model, told in many ways."""

import struct
from dataclasses import dataclass, field


@dataclass
class Model:
    """Nodes by number; curves and points by tag, each with physical tags and elements (number, kind, nodes).

    ``parts`` divides curves: part's tag to the curve's tag and the numbers of the elements in it.
    """

    nodes: dict[int, tuple[float, float, float]]
    curves: dict[int, tuple[list[int], list[tuple[int, int, list[int]]]]]
    points: dict[int, tuple[list[int], list[tuple[int, int, list[int]]]]] = field(default_factory=dict)
    names: list[tuple[int, int, str]] = field(default_factory=list)
    parts: dict[int, tuple[int, list[int]]] = field(default_factory=dict)


class _Out:
    """Numbers of a section as words of text, a line for each call of ``end``, or as bytes."""

    def __init__(self, binary: bool, order: str, size: int) -> None:
        self.binary, self.order, self.size = binary, order, size
        self.data = b""
        self.words: list[str] = []

    def put(self, form: str, *values: float) -> "_Out":
        if self.binary:
            code = {"i": "i", "s": {4: "I", 8: "Q"}[self.size], "r": "d"}[form]
            self.data += struct.pack(f"{self.order}{len(values)}{code}", *values)
        else:
            self.words += [repr(float(v)) if form == "r" else str(v) for v in values]
        return self

    def end(self) -> None:
        if not self.binary:
            self.data += " ".join(self.words).encode() + b"\n"
            self.words = []

    def section(self, name: str) -> bytes:
        return f"${name}\n".encode() + self.data + (b"\n" if self.binary else b"") + f"$End{name}\n".encode()


def _begin(model: Model, version: str, binary: bool, order: str, size: int) -> bytes:
    out = f"$MeshFormat\n{version} {int(binary)} {size}\n".encode()
    out += struct.pack(f"{order}i", 1) + b"\n" if binary else b""
    out += b"$EndMeshFormat\n"
    names = "".join(f'{d} {tag} "{name}"\n' for d, tag, name in model.names)
    return out + (
        f"$PhysicalNames\n{len(model.names)}\n{names}$EndPhysicalNames\n".encode() if names else b""
    )


def msh1(model: Model) -> bytes:
    """Return a file in format 1."""
    rows = [f"{n} {x!r} {y!r} {z!r}" for n, (x, y, z) in model.nodes.items()]
    out = ["$NOD", str(len(rows)), *rows, "$ENDNOD"]
    rows = [
        f"{n} {kind} {group} {tag} {len(nodes)} {' '.join(map(str, nodes))}"
        for entities in (model.points, model.curves)
        for tag, (groups, elements) in entities.items()
        for group in groups or [0]
        for n, kind, nodes in elements
    ]
    return "\n".join([*out, "$ELM", str(len(rows)), *rows, "$ENDELM", ""]).encode()


def msh2(model: Model, binary: bool = False, order: str = "<") -> bytes:
    """Return a file in format 2.2; an element of several groups comes once for each of them."""
    out = _Out(binary, order, 8)
    data = _begin(model, "2.2", binary, order, 8) + f"$Nodes\n{len(model.nodes)}\n".encode()
    for number, xyz in model.nodes.items():
        out.put("i", number).put("r", *xyz).end()
    data += out.data + (b"\n" if binary else b"") + b"$EndNodes\n"
    out = _Out(binary, order, 8)
    count = 0
    for entities in (model.points, model.curves):
        for tag, (groups, elements) in entities.items():
            for group in groups or [0]:
                for number, kind, nodes in elements:
                    count += 1
                    if binary:
                        out.put("i", kind, 1, 2, number, abs(group), tag, *nodes)
                    else:
                        out.put("i", number, kind, 2, abs(group), tag, *nodes).end()
    return data + f"$Elements\n{count}\n".encode() + out.data + (b"\n" if binary else b"") + b"$EndElements\n"


def msh4(
    model: Model,
    binary: bool = False,
    order: str = "<",
    size: int = 8,
    version: str = "4.1",
    parametric: bool = False,
) -> bytes:
    """Return a file in format 4.0 or 4.1, partitioned where the model has parts."""
    old = version == "4.0"

    def new() -> _Out:
        return _Out(binary, order, size)

    def groups(out: _Out, tags: list[int]) -> _Out:
        return out.put("s", len(tags)).put("i", *tags)

    data = _begin(model, version, binary, order, size)
    out = new().put("s", len(model.points), len(model.curves), 0, 0)
    out.end()
    for tag, (tags, elements) in model.points.items():
        at = model.nodes[elements[0][2][0]]
        groups(out.put("i", tag).put("r", *at, *(at if old else ())), tags).end()
    for tag, (tags, _) in model.curves.items():
        groups(groups(out.put("i", tag).put("r", 0, 0, 0, 1, 1, 1), tags), []).end()
    data += out.section("Entities")
    if model.parts:
        out = new().put("s", len(model.parts))
        out.end()
        out.put("s", 0).end()
        out.put("s", 0, len(model.parts), 0, 0).end()
        for k, (part, (curve, _)) in enumerate(model.parts.items()):
            out.put("i", part, 1, curve).put("s", 1).put("i", k + 1).put("r", 0, 0, 0, 1, 1, 1)
            groups(groups(out, []), []).end()
        data += out.section("PartitionedEntities")

    numbers = list(model.nodes)
    out = new().put("s", 2, len(numbers), *(() if old else (min(numbers), max(numbers))))
    out.end()
    half = len(numbers) // 2
    curve = next(iter(model.curves))
    for some, flag in ((numbers[:half], False), (numbers[half:], parametric)):
        out.put("i", *((curve, 1) if old else (1, curve)), int(flag)).put("s", len(some)).end()
        if not old:
            for n in some:
                out.put("s", n).end()
        for n in some:
            if old:
                out.put("i", n)
            out.put("r", *model.nodes[n], *((0.5,) if flag else ())).end()
    data += out.section("Nodes")

    divided = {n: part for part, (_, some) in model.parts.items() for n in some}
    blocks: dict[tuple[int, int, int], list[tuple[int, list[int]]]] = {}
    for dimension, entities in enumerate((model.points, model.curves)):
        for tag, (_, elements) in entities.items():
            for n, kind, nodes in elements:
                place = divided.get(n, tag) if dimension else tag
                blocks.setdefault((dimension, place, kind), []).append((n, nodes))
    every = [n for elements in blocks.values() for n, _ in elements]
    out = new().put("s", len(blocks), len(every), *(() if old else (min(every), max(every))))
    out.end()
    for (dimension, tag, kind), elements in blocks.items():
        out.put("i", *((tag, dimension) if old else (dimension, tag)), kind).put("s", len(elements)).end()
        for n, nodes in elements:
            out.put("s", n, *nodes).end()
    return data + out.section("Elements")


FORMS = {
    "1": msh1,
    "2.2": msh2,
    "2.2 binary": lambda m: msh2(m, True),
    "2.2 binary, big endian": lambda m: msh2(m, True, ">"),
    "4.0": lambda m: msh4(m, version="4.0"),
    "4.1": msh4,
    "4.1 parametric": lambda m: msh4(m, parametric=True),
    "4.1 binary": lambda m: msh4(m, True),
    "4.1 binary, parametric": lambda m: msh4(m, True, parametric=True),
    "4.1 binary, big endian": lambda m: msh4(m, True, ">"),
    "4.1 binary, 32 bit": lambda m: msh4(m, True, size=4),
}
"""Writers of all forms by their names."""
