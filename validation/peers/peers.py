#!/usr/bin/env python3
"""Compares public Mie codes with ours: error against the truth of the tests, time, and what each cannot do.

The parent needs the standard library, and gnuplot for the plot. It makes a virtual environment in the output folder,
installs each code into it, and runs every question to a code as a process of its own with a time limit, so that a
crash or a hang is a row of the table. Output: peers.json (everything), peers.md (tables), peers.png (error over size).

The truth is tests/data/mie_truth.json: amplitudes of Bohren & Huffman (1983, eq. 4.74), time factor exp(-i omega t),
m = n + ik with k >= 0, S1 perpendicular and S2 parallel to the scattering plane. Where a code's convention differs,
its adapter below converts, and says how.
"""
import argparse
import datetime
import json
import math
import os
import pathlib
import platform
import re
import shutil
import signal
import subprocess
import sys
import time
import venv

REPOSITORY = pathlib.Path(__file__).resolve().parents[2]
TRUTH = REPOSITORY / "tests" / "data" / "mie_truth.json"
OURS = "scatter"
PACKAGES = {"scatrs": "scatrs", "lxmie": "lxmie", "miepython": "miepython", "scattnlay": "scattnlay",
            "PyMieSim": "PyMieSim"}  # code: its name in the Python package index

TIMED_SIZES = [100, 1000, 10000, 50000]
TIMED_INDEX = [1.333, 0.0]
TIMED_STEP = 10  # angles per degree: 0, 0.1, .. 180
RUNS, RUN_SECONDS = 7, 10.0  # per process: the minimum of so many runs, or of those that fit into the seconds
ROUNDS = 2  # of processes, all codes in turn, so that a busy moment of the machine does not hit one code alone
TIME_LIMIT = 60.0
GROSS = 1e-6  # an error above it is called wrong

BAD_INPUT = [("size is NaN", "nan", [1.33, 0.0]), ("size is -1", "-1", [1.33, 0.0]), ("index is 0", "10", [0.0, 0.0])]
HUGE = [("x = 400000", "400000", [1.333, 0.0]), ("x = 1000000", "1000000", [1.333, 0.0])]
RESONANCE = "on a narrow resonance"  # of the truth: a case of its own, where the last digits of x decide


# ---- in the child: one adapter per code -----------------------------------------------------------------------------
# Each takes x, m (complex, k >= 0) and angles in degrees (numpy array), and returns a function that computes
# (Qext, Qsca, g, S1, S2) by the code's own interface; what only prepares input stays outside of the timed function.


def with_scatrs(x, m, degrees):
    # Conventions of Bohren & Huffman throughout; takes cos(theta). Efficiencies are a second call.
    import numpy
    from scatrs import mie
    mu = numpy.cos(numpy.radians(degrees))

    def compute():
        q, s = mie.efficiencies(x, m), mie.amplitudes(x, m, mu)
        return float(q.q_ext), float(q.q_sca), float(q.g), s.s1, s.s2

    return compute


def with_lxmie(x, m, degrees):
    # Takes cos(theta), although the argument is called angles, and n, k as two numbers. Amplitudes come out for the
    # time factor exp(+i omega t): conjugated here. Scale and order are Bohren & Huffman's.
    import lxmie
    import numpy
    mu = numpy.cos(numpy.radians(degrees)).tolist()

    def compute():
        q, s1, s2 = lxmie.mie_amplitudes(m.real, m.imag, x, mu)
        return q.q_ext, q.q_sca, q.asymmetry_parameter, numpy.conj(s1), numpy.conj(s2)

    return compute


def with_miepython(x, m, degrees):
    # Time factor exp(+i omega t), m = n - ik: index and amplitudes conjugated. Takes cos(theta). norm="wiscombe" is
    # the scale of Bohren & Huffman's S (norm="bohren" is twice it). Compiled by numba (MIEPYTHON_USE_JIT=1).
    import miepython
    import numpy
    mu = numpy.cos(numpy.radians(degrees))
    conjugate = m.conjugate()

    def compute():
        qext, qsca, _, g = miepython.efficiencies_mx(conjugate, x)
        s1, s2 = miepython.S1_S2(conjugate, x, mu, norm="wiscombe")
        return float(qext), float(qsca), float(g), numpy.conj(s1), numpy.conj(s2)

    return compute


def with_scattnlay(x, m, degrees):
    # Conventions of Bohren & Huffman; takes radians, and one layer. Double precision, as pip installs it.
    import numpy
    import scattnlay
    sizes, indices, theta = numpy.array([x]), numpy.array([m]), numpy.radians(degrees)

    def compute():
        _, qext, qsca, _, _, _, g, _, s1, s2 = scattnlay.scattnlay(sizes, indices, theta)
        return float(qext), float(qsca), float(g), s1, s2

    return compute


def with_pymiesim(x, m, degrees):
    # Takes diameter and wavelength: 2x and 2 pi in metres give back x to the last bit. Radians. Conventions of Bohren &
    # Huffman. Everything from the making of the sphere is timed, since that is where coefficients are computed.
    import numpy
    from PyMieSim.polarization import PolarizationState
    from PyMieSim.single import Simulation
    from PyMieSim.single.scatterer import Sphere
    from PyMieSim.single.source import PlaneWave
    from PyMieSim.units import ureg
    theta = numpy.radians(degrees) * ureg.radian
    light = PlaneWave(wavelength=2 * math.pi * ureg.meter, polarization=PolarizationState(angle=0 * ureg.degree),
                      amplitude=1 * ureg.volt / ureg.meter)

    def compute():
        run = Simulation(Sphere(diameter=2 * x * ureg.meter, material=m, medium=1.0), light)
        q = [float(run.run(name).magnitude) for name in ("Qext", "Qsca", "g")]
        s1, s2 = run.get_s1s2(theta)
        return *q, s1.magnitude, s2.magnitude

    return compute


ADAPTERS = {"scatrs": with_scatrs, "lxmie": with_lxmie, "miepython": with_miepython, "scattnlay": with_scattnlay,
            "PyMieSim": with_pymiesim}


def child(code):
    """Answers the question on standard input: {x, m, theta_deg, runs}, to standard output."""
    question = json.load(sys.stdin)
    answer_to = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)  # what a code prints itself is not the answer
    import numpy
    compute = ADAPTERS[code](float(question["x"]), complex(*question["m"]), numpy.array(question["theta_deg"], float))
    start = time.perf_counter()
    result = compute()  # also warms up compilers and caches
    first = time.perf_counter() - start
    # A first call that takes so long is no different from the next: it counts.
    times, start = [first] if first >= RUN_SECONDS else [], time.perf_counter()
    while first < RUN_SECONDS and len(times) < question["runs"] and (not times or time.perf_counter() - start < RUN_SECONDS):
        before = time.perf_counter()
        compute()
        times.append(time.perf_counter() - before)
    qext, qsca, g, s1, s2 = result
    pairs = [[[complex(v).real, complex(v).imag] for v in s] for s in (s1, s2)]
    json.dump({"Qext": qext, "Qsca": qsca, "g": g, "S1": pairs[0], "S2": pairs[1],
               "seconds": min(times, default=None), "first_seconds": first, "runs": len(times)}, answer_to)
    answer_to.close()
    os._exit(0)  # a crash while a code tears itself down is not an answer's fault


# ---- in the parent --------------------------------------------------------------------------------------------------


def one_thread():
    """One thread for every code: a call about one sphere uses one in all of them, but libraries may differ."""
    names = ("OMP_NUM_THREADS", "RAYON_NUM_THREADS", "NUMBA_NUM_THREADS", "OPENBLAS_NUM_THREADS")
    return dict(os.environ, MIEPYTHON_USE_JIT="1", MPLBACKEND="Agg", **{name: "1" for name in names})


def run_limited(command, question, limit):
    """(answer, None) or (None, why there is none); never raises for what a code does."""
    start = time.perf_counter()
    try:
        done = subprocess.run(command, input=question, capture_output=True, text=True, timeout=limit, env=one_thread(),
                              check=False)
    except subprocess.TimeoutExpired:
        return None, f"no answer in {limit:g} s"
    wall = time.perf_counter() - start
    if done.returncode < 0:
        return None, f"crash: {signal.Signals(-done.returncode).name}"
    if done.returncode != 0:
        lines = [line for line in done.stderr.splitlines() if line.strip()]
        return None, "refused: " + (lines[-1] if lines else f"exit status {done.returncode}")[:200]
    try:
        answer = json.loads(done.stdout)
    except ValueError:
        return None, "no readable answer"
    answer["process_seconds"] = wall
    return answer, None


class Peer:
    def __init__(self, name, python):
        self.name, self.python = name, python

    def ask(self, x, m, degrees, runs=0, limit=TIME_LIMIT):
        question = json.dumps({"x": x, "m": m, "theta_deg": degrees, "runs": runs})
        return run_limited([str(self.python), str(pathlib.Path(__file__).resolve()), "--child", self.name], question, limit)


class Ours:
    name = OURS

    def __init__(self, program, threads="1"):
        self.program, self.threads = program, threads

    def ask(self, x, m, degrees, runs=0, limit=TIME_LIMIT):
        """One process per run: the smallest "seconds" (its own clock, input to result) and smallest process time."""
        index = f"{m[0]!r}+{m[1]!r}i" if m[1] else repr(m[0])
        # The timed grid is asked for as a person would; others as a list.
        if len(degrees) == 180 * TIMED_STEP + 1:
            angles = f"0:180:{1 / TIMED_STEP!r}deg"
        else:
            angles = ",".join(f"{d!r}deg" for d in degrees)
        command = [str(self.program), "mie", f"--size-parameter={x}", f"--index={index}", f"--angles={angles}",
                   f"--threads={self.threads}", "--output=-"]
        answer, failure = run_limited(command, "", limit)
        for _ in range(runs):
            again, failure = run_limited(command, "", limit)
            if failure:
                return None, failure
            for key in ("seconds", "process_seconds"):
                answer[key] = min(answer[key], again[key])
        return answer, failure


def numbers(answer):
    yield from (answer["Qext"], answer["Qsca"], answer["g"])
    for s in (answer["S1"], answer["S2"]):
        for pair in s:
            yield from pair


def finite(answer):
    return all(isinstance(v, (int, float)) and math.isfinite(v) for v in numbers(answer))


def relative(value, truth):
    return abs(value - truth) / abs(truth)


def amplitude_errors(answer, truth):
    """Per angle: the larger error of S1 and S2, as a share of max(|S1|, |S2|) of the truth at that angle."""
    errors = []
    for got1, got2, true1, true2 in zip(answer["S1"], answer["S2"], truth["S1"], truth["S2"], strict=True):
        size = max(math.hypot(*true1), math.hypot(*true2))
        errors.append(max(math.dist(got1, true1), math.dist(got2, true2)) / size)
    return errors


def judge(answer, failure, truth):
    """One row of the accuracy table."""
    row = {"case": truth["name"], "x": truth["x"], "m": truth["m"]}
    if failure:
        return row | {"status": failure}
    if not finite(answer):
        return row | {"status": "NaN or infinity"}
    errors = amplitude_errors(answer, truth)
    # A code that takes cos(theta) cannot know an angle next to 0 or 180 deg; judged with them and without.
    away = [e for e, theta in zip(errors, truth["theta_deg"], strict=True) if theta in (0, 180) or 0.1 <= theta <= 179.9]
    row |= {"Q": max(relative(answer[q], truth[q]) for q in ("Qext", "Qsca")), "g": relative(answer["g"], truth["g"]),
            "S": max(errors), "S_away": max(away)}
    wrong = max(row["Q"], row["S_away"]) > GROSS
    return row | {"status": "wrong" if wrong else "ok"}


def install(folder, say):
    """Makes the environment; returns its python and {code: {version} or {failure}}."""
    environment = folder / "environment"
    python = environment / "bin" / "python"
    if not python.exists():
        say("making the virtual environment")
        try:
            venv.create(environment, with_pip=True)
        except (subprocess.CalledProcessError, ImportError, OSError) as error:
            sys.exit(f"peers: cannot make a virtual environment in {environment}: {error}; on Debian install python3-venv")
    found = {}
    for code, package in PACKAGES.items():
        say(f"installing {package}")
        try:
            done = subprocess.run([str(python), "-m", "pip", "install", "--disable-pip-version-check", package],
                                  capture_output=True, text=True, check=False, timeout=900)
            lines = [line for line in (done.stdout + done.stderr).splitlines() if line.strip()]
            failure = lines[-1] if done.returncode and lines else f"pip ends with {done.returncode}" if done.returncode else None
        except subprocess.TimeoutExpired:
            failure = "pip did not end in 900 s"
        if failure:
            found[code] = {"package": package, "failure": failure}
            continue
        version = subprocess.run([str(python), "-c", f"import importlib.metadata as m; print(m.version({package!r}))"],
                                 capture_output=True, text=True, check=True).stdout.strip()
        found[code] = {"package": package, "version": version}
    return python, found


def accuracy(codes, truths, say):
    rows = {code.name: [] for code in codes}
    for code in codes:
        say(f"accuracy: {code.name}")
        for truth in truths:
            answer, failure = code.ask(truth["x"], truth["m"], truth["theta_deg"])
            rows[code.name].append(judge(answer, failure, truth))
    return rows


def timing(codes, ours_all, sizes, say):
    """{code: {x: {seconds, first_seconds, process_seconds, difference} or {failure}}}; difference is from our amplitudes."""
    degrees = [i / TIMED_STEP for i in range(180 * TIMED_STEP + 1)]
    results = {code.name: {} for code in codes}
    for x in sizes:
        reference = None
        for _ in range(ROUNDS):
            for code in codes:
                say(f"time: {code.name}, x = {x}")
                before = results[code.name].get(x, {})
                if "failure" in before or before.get("seconds", 0) >= RUN_SECONDS:
                    continue
                answer, failure = code.ask(x, TIMED_INDEX, degrees, RUNS)
                if not failure and not finite(answer):
                    failure = "NaN or infinity"
                if failure:
                    results[code.name][x] = {"failure": failure}
                    continue
                if code.name == OURS:
                    reference = answer
                row = {"seconds": answer["seconds"], "first_seconds": answer.get("first_seconds", answer["seconds"])}
                if code.name == OURS:
                    row["process_seconds"] = answer["process_seconds"]
                    everything, failure = ours_all.ask(x, TIMED_INDEX, degrees, RUNS)
                    if not failure:
                        row["seconds_all_cores"] = everything["seconds"]
                if reference:
                    row["difference"] = max(amplitude_errors(answer, reference))
                for key, value in results[code.name].get(x, {}).items():
                    row[key] = min(row.get(key, value), value)
                results[code.name][x] = row
    return results


def limits(codes, say):
    """What a code does with an input that has no answer, and beyond its users' usual sizes."""
    results = {}
    for code in codes:
        say(f"limits: {code.name}")
        row = {}
        for what, x, m in [*BAD_INPUT, *HUGE]:
            answer, failure = code.ask(x, m, [0.0, 90.0, 180.0])
            if failure:
                row[what] = failure
            else:
                row[what] = "computes" if finite(answer) else "NaN or infinity, without a word"
        results[code.name] = row
    return results


# ---- what people read -----------------------------------------------------------------------------------------------


def short(value):
    """1.2e-13, in the fewest signs."""
    if value == 0:
        return "0"
    return re.sub(r"e([+-])0*(\d)", lambda match: "e" + match[1].replace("+", "") + match[2], f"{value:.0e}")


def seconds_text(seconds):
    return f"{seconds:.3g} s" if seconds >= 1 else f"{seconds * 1e3:.3g} ms"


def worst(rows, key, keep=lambda row: True):
    """The largest error over the cases, with how many failed."""
    kept = [row for row in rows if keep(row)]
    values = [row[key] for row in kept if key in row]
    failed = len(kept) - len(values)
    text = short(max(values)) if values else "-"
    return text + (f" ({failed} without result)" if failed else "")


def cannot(rows, limit_row):
    """What the measurements show that a code cannot do, in words."""
    words = []
    for row in rows:
        if row["status"] == "ok":
            continue
        why = row["status"]
        if why == "wrong":
            why = f"off by {short(max(row['Q'], row['S_away']))}"
        words.append(f"{row['case']} (x = {row['x']:.6g}, m = {row['m'][0]:g}{row['m'][1]:+g}i): {why}")
    for what, happened in limit_row.items():
        wanted = "computes" if what in [huge[0] for huge in HUGE] else "refused"
        if not happened.startswith(wanted):
            words.append(f"{what}: {'computes on' if happened == 'computes' else happened}")
    return words


def summary(report):
    """Rows of cells, the head first: what the README and the report of `scatter validate` quote."""
    timed = report["time"]
    # From where our own clock is long against its tick and the process's start.
    sizes = [x for x in report["timed_sizes"] if x in (1000, 50000)] or report["timed_sizes"]
    ours = timed[OURS]
    rows = [["code", "Qext, Qsca", "g", "S, x <= 5000", "S, narrow resonance", "S, x = 50000", *[f"time, x = {x}" for x in sizes]]]
    for code, about in report["codes"].items():
        if "failure" in about:
            rows.append([code, f"not installed: {about['failure']}"] + [""] * (len(rows[0]) - 2))
            continue
        errors = report["accuracy"][code]
        cells = [f"{code} {about['version']}", worst(errors, "Q", smooth), worst(errors, "g", smooth),
                 worst(errors, "S_away", lambda row: row["x"] <= 5000 and smooth(row)),
                 worst(errors, "S_away", lambda row: row["case"] == RESONANCE), worst(errors, "S_away", lambda row: row["x"] > 5000)]
        for x in sizes:
            entry = timed[code].get(x, {"failure": "-"})
            if "failure" in entry:
                cells.append(entry["failure"].partition(":")[0])  # "refused", without its words
            elif code == OURS:
                cells.append(seconds_text(entry["seconds"]))
            else:
                ratio = f" ({entry['seconds'] / ours[x]['seconds']:.0f} x)" if "seconds" in ours.get(x, {}) else ""
                cells.append(seconds_text(entry["seconds"]) + ratio)
        rows.append(cells)
    return rows


def smooth(row):
    return row["case"] != RESONANCE


def wins(report):
    """Where another code is better than ours, in words."""
    words = []
    kinds = [("Q", "Qext and Qsca", smooth), ("g", "g", smooth), ("S_away", "S up to x = 5000", lambda row: row["x"] <= 5000 and smooth(row)),
             ("S_away", "S on the narrow resonance", lambda row: row["case"] == RESONANCE), ("S_away", "S at x = 50000", lambda row: row["x"] > 5000)]
    for key, what, keep in kinds:
        # A code that gave up on a case has no worst error to compare.
        found = {code: [row.get(key) for row in rows if keep(row)] for code, rows in report["accuracy"].items()}
        found = {code: max(values) for code, values in found.items() if values and None not in values}
        words += [f"{code} has the smaller error of {what} ({short(error)}, ours {short(found[OURS])})"
                  for code, error in found.items() if OURS in found and error < found[OURS]]
    for x in report["timed_sizes"]:
        times = {code: timed[x]["seconds"] for code, timed in report["time"].items() if "seconds" in timed.get(x, {})}
        words += [f"{code} is faster at x = {x} ({seconds_text(t)}, ours {seconds_text(times[OURS])})"
                  for code, t in times.items() if OURS in times and t < times[OURS]]
    for what, x, _ in HUGE:
        if not report["limits"][OURS][what].startswith("computes"):
            able = [code for code, row in report["limits"].items() if row[what].startswith("computes")]
            if able:
                words.append(f"{', '.join(able)} compute{'s' if len(able) == 1 else ''} {what}, beyond the limit of ours (x = 500000)")
    return words


def remarks(report):
    """What stands below the table."""
    better = wins(report)
    return (f"Measured {report['date']}, {report['machine']}, one thread each, {180 * TIMED_STEP + 1} angles, Qext, Qsca, g, S1 and S2 in one "
            "call; in brackets the time as a multiple of ours in the same run. Ours is the first call of a new process, the others' are the "
            f"fastest of {RUNS} after a first one. Errors are the largest over {report['truths']} spheres: relative, and of S as a share of "
            "max(|S1|, |S2|) at the same angle. " +
            ("Where another code wins: " + "; ".join(better) + "." if better else "No other code wins a column."))


def summary_table(report):
    """The table that the README quotes."""
    rows = summary(report)
    lines = ["| " + " | ".join(cells) + " |" for cells in rows]
    lines.insert(1, "|" + "---|" * len(rows[0]))
    return "\n".join([*lines, "", remarks(report)])


def write_csv(report, path):
    """The same for the report of `scatter validate`: cells between semicolons, without quotes."""
    rows = [[cell.replace(";", ",") for cell in cells] for cells in summary(report)]
    path.write_text("# Made by validation/peers/run --update README.md\n# " + remarks(report) + "\n" +
                    "".join(";".join(cells) + "\n" for cells in rows))


def page(report):
    out = ["# Public Mie codes beside ours", "", summary_table(report), "",
           f"Errors are the largest over {report['truths']} spheres of tests/data/mie_truth.json (arbitrary precision): relative for "
           "Qext, Qsca and g; of S1 and S2 as a share of max(|S1|, |S2|) at the same angle, angles nearer than 0.1 deg to (but not "
           "at) 0 and 180 deg left out, since most codes take cos(theta), which cannot tell them apart; the long table has them. "
           "Rounding of angles to radians or cosines is part of a code's error: at x = 50000 it costs about 1e-11.", "",
           "Times are the smallest of several runs of what gives Qext, Qsca, g, S1 and S2: coefficients and angles together. Codes in "
           "Python are timed warm, inside their process, and by their first call, which loads and compiles; ours by the "
           "`seconds` of its answer, the first and only computation of its process. A first call of more than "
           f"{RUN_SECONDS:g} s counts as the time and is not repeated.", "", "## Time", ""]
    sizes = report["timed_sizes"]
    out += ["| code | " + " | ".join(f"x = {x}" for x in sizes) + " | S differs from ours |", "|" + "---|" * (len(sizes) + 2)]
    for code, timed in report["time"].items():
        cells = [timed[x]["failure"] if "failure" in timed[x] else seconds_text(timed[x]["seconds"]) for x in sizes]
        differences = [timed[x]["difference"] for x in sizes if "difference" in timed[x]]
        cells.append("-" if code == OURS or not differences else short(max(differences)))
        out.append(f"| {code} | " + " | ".join(cells) + " |")
        if code != OURS:
            cells = [seconds_text(timed[x]["first_seconds"]) if "first_seconds" in timed[x] else "-" for x in sizes]
            out.append(f"| {code}, first call | " + " | ".join(cells) + " | - |")
        if code == OURS:
            for key, label in (("process_seconds", "the whole process"), ("seconds_all_cores", "all cores")):
                cells = [seconds_text(timed[x][key]) if key in timed[x] else "-" for x in sizes]
                out.append(f"| {code}, {label} | " + " | ".join(cells) + " | - |")
    out += ["", "## What each cannot do", ""]
    for code, about in report["codes"].items():
        words = [f"does not install: {about['failure']}"] if "failure" in about else cannot(report["accuracy"][code], report["limits"][code])
        out.append(f"- **{code}**: " + ("answers all that was asked" if not words else ""))
        out += [f"  - {word}" for word in words]
    out += ["", "## Every case", "", "Errors Q / g / S / S without the angles beside 0 and 180 deg.", ""]
    codes = list(report["accuracy"])
    out += ["| case | x | m | " + " | ".join(codes) + " |", "|" + "---|" * (len(codes) + 3)]
    for i, row in enumerate(report["accuracy"][codes[0]]):
        cells = []
        for code in codes:
            at = report["accuracy"][code][i]
            cells.append(" / ".join(short(at[key]) for key in ("Q", "g", "S", "S_away")) if "Q" in at else at["status"])
        out.append(f"| {row['case']} | {row['x']:.6g} | {row['m'][0]:g}{row['m'][1]:+g}i | " + " | ".join(cells) + " |")
    return "\n".join(out) + "\n"


def plot(report, folder):
    """Error of S over x, the worst of the cases at each x, by gnuplot; says why where it cannot."""
    gnuplot = shutil.which("gnuplot")
    if not gnuplot:
        return "gnuplot is not installed"
    blocks, curves = [], []
    for i, (code, rows) in enumerate(report["accuracy"].items()):
        points = {}
        for row in rows:
            if "S_away" in row:
                points[row["x"]] = max(points.get(row["x"], 0), row["S_away"], 1e-17)
        blocks.append(f"$data{i} << EOD\n" + "".join(f"{x!r} {e!r}\n" for x, e in sorted(points.items())) + "EOD\n")
        curves.append(f"$data{i} using 1:2 with linespoints lw 1.5 pt {i + 4} ps 1.3 title '{code} {report['codes'][code]['version']}'")
    script = "".join(blocks) + f"""
set terminal pngcairo size 1100,700 font 'DejaVu Sans,12'
set output '{folder / "peers.png"}'
set logscale xy
set format x '10^{{%L}}'
set format y '10^{{%L}}'
set yrange [1e-17:1e3]
set xlabel 'size parameter x'
set ylabel 'largest error of S1, S2, as a share of max(|S1|, |S2|)'
set title 'Mie codes against arbitrary precision (1000 is drawn where it is more)'
set key outside right top
set grid
plot {", ".join(curve.replace("1:2", "1:($2 > 1e3 ? 1e3 : $2)") for curve in curves)}
"""
    done = subprocess.run([gnuplot], input=script, capture_output=True, text=True, check=False)
    return done.stderr.strip() or None


def update(readme, table):
    """Replaces what stands between the two marks of the README."""
    begin, end = "<!-- peers: made by validation/peers/run --update README.md -->", "<!-- /peers -->"
    text = readme.read_text()
    if begin not in text or end not in text:
        sys.exit(f"peers: {readme} lacks the marks {begin} and {end}")
    before, rest = text.split(begin, 1)
    readme.write_text(before + begin + "\n" + table + "\n" + end + rest.split(end, 1)[1])


def machine():
    try:
        model = re.search(r"model name\s*:\s*(.*)", pathlib.Path("/proc/cpuinfo").read_text())[1]
    except (OSError, TypeError):
        model = platform.machine()
    return f"{model}, load {os.getloadavg()[0]:.1f}"


def main():
    parser = argparse.ArgumentParser(prog="validation/peers/run", description=__doc__.splitlines()[0])
    parser.add_argument("folder", nargs="?", type=pathlib.Path, default=REPOSITORY / "build" / "peers", metavar="OUTPUT_FOLDER",
                        help="where everything goes, the virtual environment too [build/peers]")
    parser.add_argument("--program", type=pathlib.Path, default=REPOSITORY / "build" / "release" / "bin" / "scatter",
                        help="our program [build/release/bin/scatter]")
    parser.add_argument("--update", type=pathlib.Path, metavar="FILE", help="replace the table between the marks of FILE, and tables/accuracy/peers.csv, too")
    parser.add_argument("--quick", action="store_true", help="x up to 1000 only: does everything work?")
    parser.add_argument("--again", action="store_true", help="measure nothing: write the tables of the folder's peers.json again")
    parser.add_argument("--child", choices=ADAPTERS, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.child:
        child(options.child)
    folder = options.folder.resolve()

    def say(text):
        print(f"peers: {text}", file=sys.stderr, flush=True)

    if options.again:
        report = json.loads((folder / "peers.json").read_text())
        for timed in report["time"].values():  # JSON's keys are text
            for x in list(timed):
                timed[int(x)] = timed.pop(x)
    else:
        program = options.program.resolve()
        if not os.access(program, os.X_OK):
            sys.exit(f"peers: {options.program} is no program: build it with scripts/build release, or name it with --program")
        folder.mkdir(parents=True, exist_ok=True)
        python, installed = install(folder, say)
        codes = [Ours(program)] + [Peer(code, python) for code, about in installed.items() if "failure" not in about]
        truths = [truth for truth in json.loads(TRUTH.read_text()) if not options.quick or truth["x"] <= 1000]
        sizes = [x for x in TIMED_SIZES if not options.quick or x <= 1000]
        version = subprocess.run([str(program), "--version"], capture_output=True, text=True, check=True).stdout.split()[-1]
        report = {"date": datetime.datetime.now(datetime.timezone.utc).date().isoformat(), "machine": machine(),
                  "python": platform.python_version(), "truths": len(truths), "timed_sizes": sizes,
                  "codes": {OURS: {"version": version}} | installed}
        report["accuracy"] = accuracy(codes, truths, say)
        report["limits"] = limits(codes, say)
        report["time"] = timing(codes, Ours(program, "0"), sizes, say)
        temporary = folder / "peers.json.tmp"
        temporary.write_text(json.dumps(report, indent=1))
        temporary.replace(folder / "peers.json")
    (folder / "peers.md").write_text(page(report))
    failure = plot(report, folder)
    if failure:
        say(f"no plot: {failure}")
    if options.update:
        update(options.update, summary_table(report))
        write_csv(report, REPOSITORY / "tables" / "accuracy" / "peers.csv")
    print(summary_table(report))
    say(f"written: {folder}/peers.json, peers.md" + ("" if failure else ", peers.png"))


if __name__ == "__main__":
    main()
