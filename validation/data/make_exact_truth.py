#!/usr/bin/env python3
"""Makes exact_truth.json, what `scatter validate --case exact` holds spheres and cylinders to.

Usage: make_exact_truth.py > exact_truth.json     (needs mpmath; gmpy2 makes it fast: about two minutes without)

Hard cases out of tests/data (mie_truth.json, debye_truth.json, cylinder_truth.json: 50 digits and more, by the scripts
beside them), Debye series and cylinders thinned so that the program stays small, and the drops at the ends of the sizes
and wavelengths that the program takes, computed here by make_mie_truth.py's formulas.
"""
import json
import pathlib
import sys
from multiprocessing import Pool

DATA = pathlib.Path(__file__).resolve().parents[2] / "tests" / "data"
sys.path.insert(0, str(DATA))
sys.dont_write_bytecode = True
import make_mie_truth  # noqa: E402

PI = 3.141592653589793
# Poles, glory, the geometric primary and secondary bow of n = 1.333.
BOWS = [0, 1e-3, 0.5, 45, 90, 129.1092, 137.9219, 150, 179.999, 180]
# Water at 200 nm and 10 um: Hale & Querry 1973.
ULTRAVIOLET, INFRARED = 1.396 + 1.1e-7j, 1.218 + 0.0508j
DROPS = [
    ("drop of 5 um at 10 um", 2 * PI * 5 / 10, INFRARED, BOWS),
    ("drop of 5 um at 200 nm", 2 * PI * 5 / 0.2, ULTRAVIOLET, BOWS),
    ("drop of 3 mm at 10 um", 2 * PI * 3000 / 10, INFRARED, BOWS),
    ("drop of 1 mm, on its bows", 2 * PI * 1000 / 0.65, 1.333, BOWS),
    ("drop of 3 mm at 200 nm", 2 * PI * 3000 / 0.2, ULTRAVIOLET, BOWS),
]

DEBYE = {
    "tiny": (0, 1, 2, 3), "small metal": (0, 1, 2, 3), "beside a narrow resonance": (0, 2, 30),
    "bubble": (0, 1, 2, 3), "absorbing": (0, 1, 2, 3), "thousand, hardly absorbing": (2, 100),
    "dense": (0, 1, 2, 3), "index near 1": (0, 1, 2, 3), "drop": (0, 1, 2, 3, 4), "largest": (0, 1, 2, 3, 8),
    "largest, absorbing": (0, 1, 2, 11), "largest bubble": (0, 1, 3),
}
CYLINDER_ORDERS = ("bubble", "hair, tilted", "largest, grazing")
LEFT_OUT = ("resonance, x 51, absorbing as much", "resonance, x 50, tilted, the other", "half a width beside, x 200",
            "resonance, x 200, tilted, wide", "two widths beside, x 200, tilted", "resonance, x 500, tilted",
            "resonance, x 499, grazing, wide", "resonance, x 996, E along the axis, wide", "resonance, x 1000, tilted")


def load(name):
    return json.loads((DATA / name).read_text())


def main():
    with Pool() as pool:
        drops = pool.starmap(make_mie_truth.case, DROPS, chunksize=1)
    debye = [case for case in load("debye_truth.json") if case["name"] in DEBYE]
    assert len(debye) == len(DEBYE)
    for case in debye:
        wanted = DEBYE[case["name"]]
        # The remainder is all after the last order.
        assert case["orders"][-1]["p"] == wanted[-1]
        case["orders"] = [order for order in case["orders"] if order["p"] in wanted]
    cylinders = [case for case in load("cylinder_truth.json") if case["name"] not in LEFT_OUT]
    for case in cylinders:
        if case["name"] not in CYLINDER_ORDERS:
            case.pop("orders", None)
    print("{")
    for last, (key, cases) in enumerate([("sphere", load("mie_truth.json") + drops), ("debye", debye),
                                         ("cylinder", cylinders)]):
        print(f'"{key}": [')
        print(",\n".join(json.dumps(case, separators=(",", ":")) for case in cases))
        print("]" if last == 2 else "],")
    print("}")


if __name__ == "__main__":
    main()
