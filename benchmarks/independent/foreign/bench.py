"""FRFs of a structure with something hidden, and how clearly that shows."""

from dataclasses import dataclass, field, fields

import numpy as np
import scipy.linalg as la

from benchmarks.independent.bodies import PATCH, coupled, zeta_of
from benchmarks.independent.casefiles import AXES
from benchmarks.independent.foreign.parts import CLOSE, Beams, Place, Solid
from benchmarks.independent.foreign.real import AS_DESCRIBED, off_axis, turned

COARSE = 5
"""Every so many lines serve to see how clearly something shows."""
FLOOR_DB = -65.0
NOISE_DB = 0.1
NUISANCE = {"E": 0.01, "rho": 0.01, "damping": 0.2}
"""Steps of what an analyst does not know, beside a tenth of each joint's stiffness [-]."""


@dataclass(frozen=True)
class Hidden:
    """What a case hides; everything is nominal unless it is named here.

    Within members: ``changes`` by name.

    At connections, by (connection, direction 0 to 5): ``stiffness`` [N/m, N·m/rad], ``loss`` factors and
    ``dashpots`` [N·s/m, N·m·s/rad]; by (connection, side): ``levers`` from the stated point of action to the
    true one, global [m], and ``shifts`` along the member [m].

    On members, (member, position [m], …): ``masses`` [kg], ``inertias`` about all axes [kg·m²], ``springs``
    and ``dampers`` to the ground with a direction [N/m, N·s/m].

    Of sensors: ``gains``, ``swaps`` of names, ``tilts`` (towards a direction, angle [rad]) and ``places``
    where a sensor truly is [m].

    ``ties`` are springs between two points of members, (member, position, member, position, direction,
    stiffness [N/m]); ``absorbers`` are masses on springs, (member, position, direction, mass [kg], stiffness
    [N/m], loss factor); ``couplings`` are the shares c of k_ij = c √(k_ii k_jj) by (connection, i, j).
    """

    changes: dict = field(default_factory=dict)
    stiffness: dict = field(default_factory=dict)
    loss: dict = field(default_factory=dict)
    dashpots: dict = field(default_factory=dict)
    levers: dict = field(default_factory=dict)
    shifts: dict = field(default_factory=dict)
    masses: tuple = ()
    inertias: tuple = ()
    springs: tuple = ()
    dampers: tuple = ()
    gains: dict = field(default_factory=dict)
    swaps: tuple = ()
    tilts: dict = field(default_factory=dict)
    places: dict = field(default_factory=dict)
    ties: tuple = ()
    absorbers: tuple = ()
    couplings: dict = field(default_factory=dict)

    def __or__(self, other):
        """Return both together."""
        both = {}
        for f in fields(self):
            mine, more = getattr(self, f.name), getattr(other, f.name)
            both[f.name] = mine | more if isinstance(mine, dict) else mine + more
        return Hidden(**both)


class Bench:
    """A structure, and its parts as far as they were computed."""

    def __init__(self, structure):
        self.structure = structure
        self.parts, self.known = {}, {}

    def part(self, body, hidden=None, cuts=()):
        """Return a body's part; that with nothing changed is kept."""
        changes = tuple((m, hidden.changes[m]) for m in body if m in hidden.changes) if hidden else ()
        key = body, changes, cuts
        if key not in self.parts:
            for old in [k for k in self.parts if k[1:] != ((), ()) and k[0] == body]:
                del self.parts[old]
            make = Solid if self.structure.solid else Beams
            self.parts[key] = make(self.structure, body, dict(changes), cuts)
        return self.parts[key]

    def positions(self, member):
        return self.part(self.structure.body_of[member]).positions(member)

    def side(self, connection, k, hidden):
        """Return the place where a side of a connection acts."""
        member, s = connection.sides[k]
        along = hidden.shifts.get((connection.name, k), 0.0)
        lever = hidden.levers.get((connection.name, k), (0.0, 0.0, 0.0))
        about = connection.location + np.array(lever) + along * self.structure.members[member].axes[0]
        return Place(member, round(s + along, 9), tuple(about.tolist()), 0.0 if connection.held else PATCH)

    def sensor_place(self, sensor, hidden, test):
        """Return the place where a sensor truly is."""
        name, member = sensor["name"], sensor["member"]
        s = hidden.places.get(name, sensor["position"])
        if name not in test.offsets:
            return Place(member, s)
        return self.off(member, s, test.offsets[name])

    def off(self, member, s, offset):
        s, spot = off_axis(self.structure.members[member], s, offset)
        return Place(member, s, spot=spot)

    def body_places(self, test):
        """Return the places and masses [kg] of sensors' bodies."""
        offsets = {
            (s["member"], s["position"]): test.offsets[s["name"]]
            for s in self.structure.channels
            if test.masses
        }
        return [(self.off(*at, offsets[at]), mass) for at, mass in test.masses.items()]

    def places(self, hidden, test=AS_DESCRIBED):
        """Return all places where something acts or is read."""
        out = [Place(s["member"], s["position"]) for s in self.structure.channels]
        out += [
            self.side(c, k, hidden) for c in self.structure.connections.values() for k in range(len(c.sides))
        ]
        by_name = {s["name"]: s["member"] for s in self.structure.channels}
        out += [Place(by_name[name], s) for name, s in hidden.places.items()]
        points = (*hidden.masses, *hidden.springs, *hidden.dampers, *hidden.absorbers)
        out += [Place(m, s) for m, s, *_ in points]
        out += [Place(*at) for m1, s1, m2, s2, *_ in hidden.ties for at in ((m1, s1), (m2, s2))]
        out += [self.turning(m, s) for m, s, _ in hidden.inertias]
        out += [self.sensor_place(s, hidden, test) for s in self.structure.channels if test.offsets]
        out += [place for place, _ in self.body_places(test)]
        return list(dict.fromkeys(out))

    def turning(self, member, s):
        return Place(member, s, tuple(self.structure.members[member].at(s).tolist()), PATCH)

    def coordinates(self, hidden, nuisance, test=AS_DESCRIBED):
        """Return squared frequencies of all parts, and a function from places to motions (n, m) in them."""
        wanted, squares, columns, n = self.places(hidden, test), [], {}, 0
        base = set(self.places(Hidden()))
        for body in self.structure.bodies:
            mine = [p for p in wanted if p.member in body]
            cuts = () if self.structure.solid else self.cuts([p for p in mine if p not in base], hidden)
            w2, motions = self.part(body, hidden, cuts).reduced(mine)
            columns |= {place: (n, P) for place, P in motions.items()}
            squares.append(w2 * nuisance.get("E", 1.0) / nuisance.get("rho", 1.0))
            n += len(w2)

        def whole(place):
            start, P = columns[place]
            out = np.zeros((n, P.shape[1]))
            out[start : start + len(P)] = P / np.sqrt(nuisance.get("rho", 1.0))
            return out

        return np.concatenate(squares), whole

    def cuts(self, places, hidden):
        """Return where beams have further nodes; spots have none beside what has to have one."""
        out = [(p.member, p.s) for p in places if not p.spot]
        for place in (p for p in places if p.spot):
            m = place.member
            marks = [*self.positions(m), *(s for n, s in out if n == m)]
            marks += hidden.changes[m].notch[:2] if m in hidden.changes else ()
            if min(abs(s - place.s) for s in marks) > 2 * CLOSE * self.structure.members[m].length:
                out.append((m, place.s))
        return tuple(out)

    def frequencies(self, hidden):
        """Return natural frequencies [Hz]."""
        return self.modes(hidden)[0]

    def modes(self, hidden, nuisance=None):
        """Return natural frequencies [Hz], damping ratios, and shapes (n_sensors, n) normalised to mass.

        Damping is small: ratios are vᵀ C v / 2 ω, and shapes are real. Dashpots are left out.
        """
        nuisance = nuisance or {}
        squares, whole = self.coordinates(hidden, nuisance)
        K, M, held = np.diag(squares), np.eye(len(squares)), []
        lossy = np.zeros_like(K)
        for c in self.structure.connections.values():
            R = self.relative(c, hidden, whole)
            for i in range(6):
                if c.held and (c.name, i) not in hidden.stiffness:
                    held.append(R[:, i] / np.linalg.norm(R[:, i]))  # as a spring it would cost all digits
                    continue
                k = hidden.stiffness.get((c.name, i), c.k[i] * nuisance.get(c.name, 1.0))
                K += k * np.outer(R[:, i], R[:, i])
                lossy += hidden.loss.get((c.name, i), c.loss) * k * np.outer(R[:, i], R[:, i])
        for m, s, d, k in hidden.springs:
            P = whole(Place(m, s))[:, [AXES.index(d)]]
            K += k * P @ P.T
        for m, s, mass in hidden.masses:
            P = whole(Place(m, s))
            M += mass * P @ P.T
        for m, s, J in hidden.inertias:
            P = whole(self.turning(m, s))[:, 3:]
            M += J * P @ P.T
        B = la.null_space(np.array(held)) if held else np.eye(len(squares))
        w2, V = la.eigh(B.T @ K @ B, B.T @ M @ B)
        w2, V = np.maximum(w2, 0.0), B @ V
        viscous = (2 * zeta_of(self.structure.damping, squares) * np.sqrt(squares)) @ V**2
        omega = np.maximum(np.sqrt(w2), 1e-9)
        zeta = viscous / (2 * omega) + np.einsum("ij,ij->j", V, lossy @ V) / (2 * omega**2)
        shapes = np.array([self.reading(s, hidden, whole) for s in self.structure.channels]) @ V
        return np.sqrt(w2) / (2 * np.pi), zeta, shapes

    def receptances(self, hidden, omega, nuisance=None, test=AS_DESCRIBED):
        """Return FRFs (n_freq, n_sensors, n_excitations) [m/N], with factors of what is uncertain."""
        nuisance, structure = nuisance or {}, self.structure
        squares, whole = self.coordinates(hidden, nuisance, test)
        parts = [
            (self.relative(c, hidden, whole), dynamic_stiffness(c, hidden, omega, nuisance.get(c.name, 1.0)))
            for c in structure.connections.values()
        ]
        parts += attachments(hidden, omega, whole, self.turning)
        inputs, fixtures = self.inputs(omega, whole, test)
        parts += fixtures
        out = np.array([self.reading(s, hidden, whole, test) for s in structure.channels]).T
        zeta = zeta_of(structure.damping, squares) * nuisance.get("damping", 1.0)
        return coupled(squares, np.zeros(len(squares)), zeta, parts, out, inputs, omega)

    def relative(self, connection, hidden, whole):
        """Return the relative motion (n, 6) of a connection's sides."""
        first, *other = (whole(self.side(connection, k, hidden)) for k in range(len(connection.sides)))
        return first - other[0] if other else first

    def reading(self, sensor, hidden, whole, test=AS_DESCRIBED):
        """Return the motion (n,) that a sensor takes, where it truly is and in its true direction."""
        name = sensor["name"]
        motions = whole(self.sensor_place(sensor, hidden, test))
        towards, angle = hidden.tilts.get(name, (sensor["direction"], 0.0))
        if name in test.turns:
            one, other = (np.eye(3)[AXES.index(d)] for d in (sensor["direction"], towards))
            return motions @ turned(np.cos(angle) * one + np.sin(angle) * other, test.turns[name])
        along, across = (motions[:, AXES.index(d)] for d in (sensor["direction"], towards))
        return along if angle == 0 else np.cos(angle) * along + np.sin(angle) * across

    def inputs(self, omega, whole, test):
        """Return the motions (n, n_excitations) that forces take, and what the test hangs on members."""
        w, at, inputs = omega[:, None, None], {s["name"]: s for s in self.structure.channels}, []
        fixtures = [(whole(place), -(w**2) * mass * np.eye(3)) for place, mass in self.body_places(test)]
        for name in self.structure.excitations:
            motions = whole(Place(at[name]["member"], at[name]["position"]))
            force = turned(
                np.eye(3)[AXES.index(at[name]["direction"])], test.force_turns.get(name, (0, 0, 0))
            )
            inputs.append(motions @ force)
            across = test.stingers.get(name, 0.0) * (np.eye(3) - np.outer(force, force))
            if name in test.stingers or name in test.drivers:
                fixtures.append((motions, across - w**2 * test.drivers.get(name, 0.0) * np.eye(3)))
        return np.array(inputs).T, fixtures

    def accelerances(self, hidden, every=1, nuisance=None, test=AS_DESCRIBED):
        """Return FRFs [m/s²/N] without noise as the instruments read them."""
        frequency = self.structure.frequency[::every]
        omega = 2 * np.pi * frequency
        H = -(omega[:, None, None] ** 2) * self.receptances(hidden, omega, nuisance, test)
        names = [s["name"] for s in self.structure.channels]
        for name, gain in (*hidden.gains.items(), *test.gains.items()):
            H[:, names.index(name)] *= gain
        for pair in hidden.swaps:
            i, j = (names.index(name) for name in pair)
            H[:, [i, j]] = H[:, [j, i]]
        return H

    # how clearly something shows ------------------------------------------------------------------------

    def coarse(self, hidden, test=AS_DESCRIBED, **nuisance):
        """Return ln |H| on some lines (n, n_out, n_in), not below the noise floor; results are kept."""
        key = repr((hidden, test, sorted(nuisance.items())))
        if key not in self.known:
            H = self.accelerances(hidden, COARSE, nuisance, test)
            floor = np.abs(H).max(axis=0) * 10 ** (FLOOR_DB / 20)
            self.known[key] = 0.5 * np.log(np.abs(H) ** 2 + floor**2)
        return self.known[key]

    def nuisances(self):
        """Return what a step of each uncertain quantity changes, in columns."""
        nothing = self.coarse(Hidden())
        steps = NUISANCE | {c.name: 0.1 for c in self.structure.joints}
        return np.array(
            [(self.coarse(Hidden(), **{key: 1 + s}) - nothing).ravel() for key, s in steps.items()]
        ).T

    def change(self, hidden, beside):
        """Return the rms change [dB] by what is hidden beside something, and what nuisances leave of it.

        Nuisances take part with steps of a standard deviation each, against 0.1 dB of noise.
        """
        return self.left(self.coarse(hidden | beside) - self.coarse(beside))

    def change_by_test(self, hidden, test):
        """Return the rms change [dB] by a test beside what is hidden, and what nuisances leave of it."""
        return self.left(self.coarse(hidden, test) - self.coarse(hidden))

    def left(self, change):
        """Return the rms of a change of ln |H| [dB], and what nuisances leave of it."""
        to_db = 20 / np.log(10)
        d = to_db * change.ravel()
        X = to_db * self.nuisances()
        scale = NOISE_DB * np.sqrt(len(d) / 8)  # neighbouring lines are not independent
        c = np.linalg.solve(X.T @ X / scale**2 + np.eye(X.shape[1]), X.T @ d / scale**2)
        return float(np.sqrt(np.mean(d**2))), float(np.sqrt(np.mean((d - X @ c) ** 2)))

    def change_of(self, sensors, hidden, beside):
        """Return the rms change [dB] of the FRFs of some sensors, phase as well as amplitude."""
        names = [s["name"] for s in self.structure.channels]
        rows = [names.index(name) for name in sensors]
        new, old = (self.accelerances(h, COARSE)[:, rows] for h in (hidden | beside, beside))
        floor = np.abs(old).max(axis=0) * 10 ** (FLOOR_DB / 20)
        share = np.minimum(np.abs(new - old) / (np.abs(old) + floor), 2.0)
        return float(20 / np.log(10) * np.sqrt(np.mean(share**2)))


def dynamic_stiffness(connection, hidden, omega, factor):
    """Return the dynamic stiffness (n_freq, 6, 6) of a connection."""
    name = connection.name
    k = connection.k * (1.0 if connection.held else factor)
    k = np.array([hidden.stiffness.get((name, i), k[i]) for i in range(6)])
    eta = np.array([hidden.loss.get((name, i), connection.loss) for i in range(6)])
    c = np.array([hidden.dashpots.get((name, i), 0.0) for i in range(6)])
    Z = np.zeros((len(omega), 6, 6), dtype=complex)
    Z[:, range(6), range(6)] = k * (1 + 1j * eta) + 1j * omega[:, None] * c
    for (connected, i, j), share in hidden.couplings.items():
        if connected == name:
            Z[:, i, j] = Z[:, j, i] = share * np.sqrt(k[i] * k[j])
    return Z


def attachments(hidden, omega, whole, turning):
    """Return what hangs on members: motions (n, m) and dynamic stiffness (n_freq, m, m)."""
    w = omega[:, None, None]
    out = [(whole(Place(m, s)), -(w**2) * mass * np.eye(3)) for m, s, mass in hidden.masses]
    out += [(whole(turning(m, s))[:, 3:], -(w**2) * J * np.eye(3)) for m, s, J in hidden.inertias]
    for m, s, d, k in hidden.springs:
        out.append((whole(Place(m, s))[:, [AXES.index(d)]], k * np.ones_like(w)))
    for m, s, d, c in hidden.dampers:
        out.append((whole(Place(m, s))[:, [AXES.index(d)]], 1j * w * c))
    for m1, s1, m2, s2, d, k in hidden.ties:
        apart = whole(Place(m1, s1)) - whole(Place(m2, s2))
        out.append((apart[:, [AXES.index(d)]], k * np.ones_like(w)))
    for m, s, d, mass, k, eta in hidden.absorbers:
        soft, inertia = k * (1 + 1j * eta), -(w**2) * mass
        out.append((whole(Place(m, s))[:, [AXES.index(d)]], soft * inertia / (soft + inertia)))
    return out
