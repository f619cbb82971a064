#!/usr/bin/env python3
"""Times Mitsuba 3's hair beside ours, on the same directions in the same run: validation/peers/hair.py [OPTION...]

Makes a virtual environment in the output folder, installs Mitsuba and numpy from the Python package index into it, and
runs Mitsuba there on one thread. Its vectorised variant compiles with LLVM 17 or newer: where the system's is older,
name another in DRJIT_LIBLLVM_PATH (Debian's libllvm19 has it). Ours is `scatter fiber hair`, which evaluates on one
thread; both times are of the evaluation alone. The models differ: Mitsuba's (Chiang et al. 2016) takes one offset across
the fibre per evaluation and logistic lobes, in single precision; ours integrates over the offset, with Marschner's lobes
and exact roots, in double precision. So speed is compared, not values. Output: hair.json and a line per code.
"""
import argparse
import json
import math
import pathlib
import random
import subprocess
import sys
import venv

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
RUNS = 15  # of which the fastest counts, as what else the machine does disturbs it least


def make_directions(count):
    """Pairs of unit vectors, even over the sphere, x along the fibre."""
    generator = random.Random(1)

    def one():
        along, around = generator.uniform(-1, 1), generator.uniform(-math.pi, math.pi)
        across = math.sqrt(1 - along * along)
        return [along, across * math.sin(around), across * math.cos(around)]

    return [{"light": one(), "view": one()} for _ in range(count)]


def child(path, variant):
    """In the virtual environment: the time of Mitsuba's evaluation [s]."""
    import time
    import drjit as dr
    import mitsuba as mi
    import numpy as np
    pairs = json.loads(pathlib.Path(path).read_text())
    mi.set_variant(variant)
    hair = mi.load_dict({"type": "hair", "sigma_a": {"type": "rgb", "value": [0.2, 0.3, 0.5]},
                         "longitudinal_roughness": 0.3, "azimuthal_roughness": 0.3, "scale_tilt": 5.0,
                         "int_ior": 1.55})
    context = mi.BSDFContext()
    scalar = variant.startswith("scalar")
    many = pairs[:20000] if scalar else pairs
    light = np.array([p["light"] for p in many])
    view = np.array([p["view"] for p in many])
    offset = np.linspace(0.01, 0.99, len(many))
    best = math.inf
    if scalar:  # the calls from Python are in it
        si = mi.SurfaceInteraction3f()
        lights = [mi.Vector3f(*w) for w in light]
        views = [mi.Vector3f(*w) for w in view]
        offsets = [mi.Point2f(0.5, v) for v in offset]
        for _ in range(3):
            start = time.perf_counter()
            for i in range(len(many)):
                si.wi = lights[i]
                si.uv = offsets[i]
                hair.eval(context, si, views[i], True)
            best = min(best, time.perf_counter() - start)
    else:
        dr.set_thread_count(1)
        si = dr.zeros(mi.SurfaceInteraction3f, len(many))
        si.wi = mi.Vector3f(*[mi.Float(np.float32(light[:, k])) for k in range(3)])
        si.uv = mi.Point2f(0.5, mi.Float(np.float32(offset)))
        wo = mi.Vector3f(*[mi.Float(np.float32(view[:, k])) for k in range(3)])
        dr.eval(si, wo)
        for _ in range(RUNS):  # the first compiles
            dr.sync_thread()
            start = time.perf_counter()
            value = hair.eval(context, si, wo, mi.Bool(True))
            dr.eval(value)
            dr.sync_thread()
            best = min(best, time.perf_counter() - start)
        if not np.isfinite(np.array(value)).all():
            raise RuntimeError("values that are not finite")
    print(json.dumps({"version": mi.__version__, "seconds": best / len(many)}))


def main():
    parser = argparse.ArgumentParser(description="Times Mitsuba 3's hair beside ours.")
    parser.add_argument("output", nargs="?", default=str(REPOSITORY / "build" / "peers"), help="folder [build/peers]")
    parser.add_argument("--scatter", default=str(REPOSITORY / "build" / "release" / "bin" / "scatter"))
    parser.add_argument("--directions", type=int, default=100_000)
    parser.add_argument("--child", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        return child(*options.child)

    folder = pathlib.Path(options.output)
    folder.mkdir(parents=True, exist_ok=True)
    environment = folder / "environment-hair"
    python = environment / "bin" / "python"
    if not python.exists():
        venv.create(environment, with_pip=True)
        subprocess.run([str(python), "-m", "pip", "--quiet", "install", "mitsuba", "numpy"], check=True, timeout=900)
    directions, parameters = folder / "hair-directions.json", folder / "hair-parameters.json"
    directions.write_text(json.dumps(make_directions(options.directions)))
    parameters.write_text(json.dumps({"eta": 1.55, "sigma_a": [0.2, 0.3, 0.5], "shift_deg": -5, "width_deg": 7.5}))

    result = {"directions": options.directions, "nanoseconds": {}, "failures": {}}
    ours = math.inf
    for _ in range(RUNS):
        answer = subprocess.run([options.scatter, "fiber", "hair", "--params", str(parameters), "--directions",
                                 str(directions)], check=True, capture_output=True, text=True, timeout=300)
        ours = min(ours, json.loads(answer.stdout)["seconds"] / options.directions)
    result["nanoseconds"]["scatter"] = 1e9 * ours
    # A process each: compilers end the process when they fail.
    for variant in ("llvm_ad_rgb", "scalar_rgb"):
        name = "mitsuba " + variant
        try:
            answer = subprocess.run([str(python), __file__, "--child", str(directions), variant], capture_output=True,
                                    text=True, timeout=600)
        except subprocess.TimeoutExpired:
            result["failures"][name] = "no answer in 600 s"
            continue
        if answer.returncode == 0:
            theirs = json.loads(answer.stdout.splitlines()[-1])
            result["mitsuba"] = theirs["version"]
            result["nanoseconds"][name] = 1e9 * theirs["seconds"]
        else:
            lines = [line for line in answer.stderr.splitlines() if "rror" in line] or answer.stderr.splitlines()
            result["failures"][name] = lines[0][:200] if lines else f"ends with {answer.returncode}"
    (folder / "hair.json").write_text(json.dumps(result, indent=1) + "\n")
    for code, nanoseconds in result["nanoseconds"].items():
        print(f"{code}: {nanoseconds:.1f} ns per pair of directions, {1e3 / nanoseconds:.2f} million a second")
    for code, failure in result["failures"].items():
        print(f"{code}: {failure}", file=sys.stderr)


if __name__ == "__main__":
    main()
