#!/usr/bin/env python3
"""Writes cloth_truth.json: threads and fabrics evaluated with 40 digits, apart from the library.

Needs mpmath. The fabrics are typed in again from the dissertation's tables 5.2 and E.1 rather than read from
tables/fabrics, so the test holds those files against the print too. Angles here come from arc functions,
Fresnel's coefficients from Snell's law with angles: the library does neither.

Run: python3 tests/data/make_cloth_truth.py > tests/data/cloth_truth.json    (two minutes)
"""
import json
import random

from mpmath import acos, asin, atan2, cos, exp, mp, mpf, pi, sin, sqrt, tan

mp.dps = 40
DEG = pi / 180
SAMPLES = 64


def d(text):
    return mpf(text)


# fabric: [(eta, kd, gamma_s, gamma_v, area, colour, scale, offsets, lengths)], as printed
LINEN = ("1.46", ".3", "12", "24", ".33", (".2", ".8", "1"), ".3", ("-25", "25"), ("1",))
POLYESTER = ("1", ".37", ".3")
CREPE = ("1", ".95", ".05")
FABRICS = {
    "linen-plain": [LINEN, LINEN],
    "silk-crepe-de-chine": [
        ("1.345", ".2", "5", "10", ".75", CREPE, ".12", ("-35", "-35", "35", "35"), ("1", "1", "1")),
        ("1.345", ".3", "18", "32", ".25", CREPE, ".16", ("0", "0"), ("1",)),
    ],
    "polyester-satin-front": [
        ("1.539", ".1", "2.5", "5", ".90", POLYESTER, ".035",
         ("-32", "-32", "-18", "0", "0", "18", "32", "32"), ("1.33", ".66", "2", "2", "2", ".66", "1.33")),
        ("1.539", ".7", "30", "60", ".10", POLYESTER, ".2", ("0", "0"), ("1",)),
    ],
    "polyester-satin-back": [
        ("1.539", ".1", "2.5", "5", ".67", POLYESTER, ".035",
         ("-30", "-30", "30", "30", "-5", "-5", "5", "5"), ("1.33", "1.33", "1.33", "0", ".67", ".67", ".67")),
        ("1.539", ".7", "30", "60", ".33", POLYESTER, ".2", ("0", "0"), ("1",)),
    ],
    "silk-shot": [
        ("1.345", ".1", "4", "8", ".86", (".1", "1", ".4"), ".2", ("-25", "-25", "25", "25"),
         ("1.33", "2.67", "1.33")),
        ("1.345", ".1", "5", "10", ".14", ("1", "0", ".1"), ".6", ("0", "0"), ("1",)),
    ],
    "velvet": [
        ("1.46", ".1", "6", "12", ".5", (".05", ".02", "0"), ".3", ("-90", "-50"), ("1",)),
        ("1.46", ".1", "6", "12", ".5", (".05", ".02", "0"), ".3", ("-90", "-55", "55", "90"), (".5", "0", ".5")),
    ],
}


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def clamp(x):
    return max(mpf(-1), min(mpf(1), x))


def gauss(gamma, x):
    return exp(-x * x / (2 * gamma * gamma)) / (gamma * sqrt(2 * pi))


def fresnel(eta, incidence):
    """Reflectivity of unpolarised light by Snell's law and the sines and tangents of the angles."""
    if incidence < mpf(10) ** -15:
        return ((eta - 1) / (eta + 1)) ** 2
    refracted = asin(sin(incidence) / eta)
    s = sin(incidence - refracted) / sin(incidence + refracted)
    p = tan(incidence - refracted) / tan(incidence + refracted)
    return (s * s + p * p) / 2


def wrap(x):
    while x > pi:
        x -= 2 * pi
    while x <= -pi:
        x += 2 * pi
    return x


def thread_lobes(thread, theta_i, theta_r, phi_d, energy_true):
    """Surface and volume part of f_s."""
    eta, kd = d(thread[0]), d(thread[1])
    gamma_s, gamma_v = d(thread[2]) * DEG, d(thread[3]) * DEG
    theta_h, theta_d = (theta_i + theta_r) / 2, (theta_r - theta_i) / 2
    fr = fresnel(eta, acos(clamp(cos(theta_d) * cos(phi_d / 2))))
    surface = fr * cos(phi_d / 2) * gauss(gamma_s, theta_h) / (8 if energy_true else 1)
    volume = (1 - fr) ** 2 * ((1 - kd) * gauss(gamma_v, theta_h) + kd) / (cos(theta_i) + cos(theta_r))
    return surface / cos(theta_d) ** 2, volume / cos(theta_d) ** 2


def colour(thread):
    return [d(c) * d(thread[6]) for c in thread[5]]


def curve(offsets, lengths, count):
    offsets, lengths = [d(o) for o in offsets], [d(l) for l in lengths]
    total = sum(lengths)
    samples = []
    for k in range(count):
        at = (k + mpf(1) / 2) * total / count
        for i, length in enumerate(lengths):
            if at < length:
                samples.append((offsets[i] + (offsets[i + 1] - offsets[i]) * at / length) * DEG)
                break
            at -= length
    assert len(samples) == count
    return samples


def together(m_i, m_r, difference, s):
    u = exp(-difference * difference / (2 * s * s))
    return (1 - u) * m_i * m_r + u * min(m_i, m_r)


def cloth(fabric, light, view, energy_true=False):
    w_i, w_r = [mpf(x) for x in light], [mpf(x) for x in view]
    if w_i[2] <= 0 or w_r[2] <= 0:
        return [mpf(0)] * 3
    w_i, w_r = ([x / sqrt(dot(w, w)) for x in w] for w in (w_i, w_r))
    s = 20 * DEG
    value = [mpf(0)] * 3
    q = (1 - sum(d(t[4]) for t in fabric)) * max(w_r[2], 0)
    axes = [((1, 0, 0), (0, -1, 0)), ((0, 1, 0), (1, 0, 0))]
    for thread, (along, binormal) in zip(fabric, axes):
        area = d(thread[4]) / SAMPLES
        for o in curve(thread[7], thread[8], SAMPLES):
            t = [cos(o) * along[k] + (sin(o) if k == 2 else 0) for k in range(3)]
            n = [-sin(o) * along[k] + (cos(o) if k == 2 else 0) for k in range(3)]
            psi_i, psi_r = (atan2(dot(w, t), dot(w, n)) for w in (w_i, w_r))
            phi_i, phi_r = (atan2(dot(w, binormal), dot(w, n)) for w in (w_i, w_r))
            projected = together(max(cos(psi_i), 0), max(cos(psi_r), 0), wrap(psi_i - psi_r), s)
            q += area * projected
            theta_i, theta_r = (asin(clamp(dot(w, t))) for w in (w_i, w_r))
            if cos(theta_i) < mpf(10) ** -8 or cos(theta_r) < mpf(10) ** -8:
                continue
            phi_d = wrap(phi_r - phi_i)
            masked = together(max(cos(phi_i), 0), max(cos(phi_r), 0), phi_d, s)
            if masked == 0 or projected == 0:
                continue
            surface, volume = thread_lobes(thread, theta_i, theta_r, phi_d, energy_true)
            for c, a in enumerate(colour(thread)):
                value[c] += area * (surface + a * volume) * masked * projected * cos(theta_i)
    return [v / q for v in value] if q > 0 else [mpf(0)] * 3


def direction(theta, azimuth):
    """Unit vector as the doubles that the library gets; degrees."""
    t, a = mpf(theta) * DEG, mpf(azimuth) * DEG
    return [float(sin(t) * cos(a)), float(sin(t) * sin(a)), float(cos(t))]


def cloth_pairs(offset):
    pairs = []
    for theta_i in (0, 30, 60):  # the planes of incidence of the dissertation's plots
        for theta_r in (-75, -40, 0, 25, 70):
            for azimuth in (0, 90):
                pairs.append((direction(-theta_i, azimuth), direction(theta_r, azimuth)))
    rng = random.Random(5)
    for _ in range(16):
        pairs.append((direction(rng.uniform(0, 89), rng.uniform(0, 360)),
                      direction(rng.uniform(0, 89), rng.uniform(0, 360))))
    pairs.append((direction(35, 20), direction(35, 20)))  # light behind the eye
    pairs.append((direction(35, 20), direction(35.5, 21)))
    pairs.append((direction(0, 0), direction(0, 0)))
    for grazing in (89.5, 89.99):
        pairs.append((direction(grazing, 33), direction(10, 120)))
        pairs.append((direction(10, 120), direction(grazing, 33)))
        pairs.append((direction(grazing, 33), direction(grazing, 80)))
        pairs.append((direction(grazing, 33), direction(grazing, 213)))
        pairs.append((direction(grazing, 0), direction(-grazing, 0)))  # along thread 1
    pairs.append((direction(90 - offset, 0), direction(40, 10)))  # along a tangent, in the light
    pairs.append((direction(40, 10), direction(90 - offset, 0)))  # and in the view
    pairs.append((direction(120, 15), direction(20, 0)))  # below the cloth
    pairs.append((direction(20, 15), direction(100, 0)))
    return pairs


def main():
    out = {"thread": [], "cloth": []}
    rng = random.Random(3)
    threads = {"silk": FABRICS["silk-crepe-de-chine"][0], "linen": LINEN,
               "polyester": FABRICS["polyester-satin-front"][0], "twisted": FABRICS["polyester-satin-front"][1]}
    for name, thread in threads.items():
        angles = [(0, 0, 0), (10, -10, 0), (30, -32, 120), (80, -79, 20), (80, 75, 60), (-5, 4, 179.9),
                  (89.5, -89.4, 10), (89.5, 89.4, 10), (0, 88, 45)]
        angles += [(rng.uniform(-88, 88), rng.uniform(-88, 88), rng.uniform(-180, 180)) for _ in range(20)]
        for theta_i, theta_o, phi in angles:
            radians = [float(mpf(a) * DEG) for a in (theta_i, theta_o, phi)]
            for variant in ("printed", "energy-true"):
                surface, volume = thread_lobes(thread, *(mpf(a) for a in radians), variant == "energy-true")
                out["thread"].append({
                    "thread": name, "variant": variant, "angles": radians,
                    "surface": float(surface), "volume": float(volume)})
    for name, fabric in FABRICS.items():
        offset = max(abs(float(o)) for o in fabric[0][7])
        for k, (light, view) in enumerate(cloth_pairs(offset)):
            variant = "energy-true" if k % 7 == 3 else "printed"
            value = cloth(fabric, light, view, variant == "energy-true")
            out["cloth"].append({"fabric": name, "variant": variant, "light": light, "view": view,
                                 "value": [float(v) for v in value]})
    print(json.dumps(out, indent=None, separators=(",", ":")).replace("},{", "},\n{"))


if __name__ == "__main__":
    main()
