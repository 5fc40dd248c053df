"""Files of a case: nominal.json, FRFs in UFF 58 with noise, and the words of truth.json."""

import json
import sys
from pathlib import Path

import numpy as np

AXES = "xyz"
DIRECTIONS = ("x", "y", "z", "rx", "ry", "rz")
NOISE, NOISE_FLOOR_DB = 0.01, -65.0
NOTHING = {"type": "none", "location": "-", "magnitude": 0}


def named(kind, *place, value, unit, position=None, length=None):
    """Return what truth.json says of an effect in Dovetail's words; several kinds if they say the same."""
    return {
        "type": "named",
        "kind": [kind] if isinstance(kind, str) else list(kind),
        "place": list(place),
        "value": value,
        "unit": unit,
        "position": position,
        "length": length,
        "location": " ".join(place),
        "magnitude": value,
    }


def fault(sensor, **magnitude):
    """Return what truth.json says of a sensor's fault: ``factor``, ``delay_s``, ``swapped_with``, …"""
    return {"type": "sensor_fault", "location": sensor, "magnitude": magnitude}


def with_noise(H, rng, share=NOISE):
    """Return FRFs with noise of a share of each value and `NOISE_FLOOR_DB` under the peak of each."""
    floor = np.abs(H).max(axis=0) * 10 ** (NOISE_FLOOR_DB / 20)

    def noise():
        return (rng.standard_normal(H.shape) + 1j * rng.standard_normal(H.shape)) / np.sqrt(2)

    return H * (1 + share * noise()) + floor * noise()


def write_nominal(target, nominal):
    """Write nominal.json into the folder of a case."""
    target.mkdir(parents=True, exist_ok=True)
    (target / "nominal.json").write_text(json.dumps(nominal, indent=1), encoding="utf-8")


def write_files(target, nominal, frequency, H, file="frf.uff"):
    """Write nominal.json and a file of FRFs, H of its sensors and excitations (n_freq, n_out, n_in).

    FRFs to a ``base`` or to a ``reference`` are transmissibilities: accelerations over an acceleration, which
    pyuff writes as FRFs.
    """
    import pyuff

    write_nominal(target, nominal)
    (target / file).unlink(missing_ok=True)
    by_name = {s["name"]: s for s in nominal["sensors"]}
    sets, empty = [], {"type": 58, "binary": 0}
    empty |= dict.fromkeys(("func_id", "ver_num", "load_case_id", "z_axis_value", "z_axis_spec_data_type"), 0)
    empty |= dict.fromkeys(("id1", "id2", "id3", "id4", "id5", "rsp_ent_name", "ref_ent_name"), "NONE")
    for axis in ("abscissa", "ordinate", "orddenom", "z_axis"):
        empty |= {f"{axis}_{unit}_unit_exp": 0 for unit in ("len", "force", "temp")}
        empty |= {f"{axis}_axis_lab": "NONE", f"{axis}_axis_units_lab": "NONE"}
    for i, sensor in enumerate(nominal["sensors"]):
        for j, excitation in enumerate(nominal["excitations"]):
            name = excitation.get("reference", excitation.get("sensor"))
            at = by_name[name] if name else {"node": excitation["node"], "direction": excitation["base"]}
            is_force = not excitation.keys() & {"base", "reference"}
            given = {
                "func_type": 4,
                "rsp_node": sensor["node"],
                "rsp_dir": 1 + AXES.index(sensor["direction"]),
                "ref_node": at["node"],
                "ref_dir": 1 + AXES.index(at["direction"]),
                "ord_data_type": 5,
                "num_pts": len(frequency),
                "abscissa_spacing": 1,
                "abscissa_min": frequency[0],
                "abscissa_inc": frequency[1] - frequency[0],
                "abscissa_spec_data_type": 18,
                "ordinate_spec_data_type": 12,
                "orddenom_spec_data_type": 13 if is_force else 12,
                "x": frequency,
                "data": H[:, i, j],
            }
            sets.append(empty | given)
    pyuff.UFF(str(target / file)).write_sets(sets, "overwrite")


def write_cases(argv, cases, write):
    """Write the cases of some names, all without names, into a folder: the arguments are folder and names.

    ``write(folder, name)`` writes one case and returns its truth. ``truth.json`` keeps earlier truths.
    """
    folder, names = Path(argv[0]), argv[1:] or list(cases)
    folder.mkdir(parents=True, exist_ok=True)
    truth = folder / "truth.json"
    known = json.loads(truth.read_text(encoding="utf-8")) if truth.exists() else {}
    for name in names:
        known[name] = write(folder, name)
        truth.write_text(json.dumps(known, indent=1), encoding="utf-8")
        sys.stderr.write(f"{folder / name}\n")
