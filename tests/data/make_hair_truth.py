#!/usr/bin/env python3
"""Makes hair_truth.json: hair's scattering function, averages of assemblies and the artists' model, independently.

Needs mpmath and numpy. Values of f_s and of the artists' model: 40 digits, roots of the exit azimuth by bisection
between sign changes on a fine grid of h. Averages: brute-force quadrature in two dimensions, over theta_o and over
the offset h of rays, whose exit azimuth phi(h) is weighed with |phi|/pi; composite Gauss-Legendre rules in double
precision with edges where phi(h) passes the light's azimuth. The sums over the paths among strands follow from the
averages by the closed forms, which the tests hold against explicit sums.
"""
import json
import math
import pathlib

import mpmath as mp
import numpy as np

mp.mp.dps = 40
ETA = 1.55


def fresnel(eta, cosine):
    """Mean of both polarisations; any array of cosines."""
    inner = np.sqrt(eta * eta - 1 + cosine * cosine)
    s = (cosine - inner) / (cosine + inner)
    p = (eta * eta * cosine - inner) / (eta * eta * cosine + inner)
    return (s * s + p * p) / 2


def shifts_and_widths(shift, width):
    return [shift, -shift / 2, -3 * shift / 2, -3 * shift / 2], [width, width / 2, 2 * width, 2 * width]


# ---- averages -------------------------------------------------------------------------------------------------------

NODES, WEIGHTS = np.polynomial.legendre.leggauss(24)


def rule(edges, panels):
    """Abscissas and weights of a composite rule between the edges, each piece cut into so many panels."""
    x, w = [], []
    for a, b in zip(edges[:-1], edges[1:]):
        cuts = np.linspace(a, b, panels + 1)
        for c, d in zip(cuts[:-1], cuts[1:]):
            x.append((c + d) / 2 + (d - c) / 2 * NODES)
            w.append((d - c) / 2 * WEIGHTS)
    return np.concatenate(x), np.concatenate(w)


def azimuth_energy(lobe, eta, sigma, theta_d):
    """Energy and its forward share at theta_d of R, TT, TRT or the residual, by a sum over rays h = sin gamma > 0."""
    s, c = math.sin(theta_d), math.cos(theta_d)
    bravais = math.sqrt(eta * eta - s * s) / c

    def phi(p, gamma):
        return 2 * p * np.arcsin(np.sin(gamma) / bravais) - 2 * gamma + p * math.pi

    edges = [0.0, math.pi / 2]
    if lobe == 2 and bravais < 2:  # 4 gamma_t - 2 gamma_i passes 0 where sin gamma_i = eta' sin(gamma_i / 2)
        crossing = 2 * math.acos(bravais / 2)
        if crossing < math.pi / 2:
            edges = [0.0, crossing, math.pi / 2]
    gamma, weight = rule(edges, 8)
    weight = 2 * weight * np.cos(gamma) / 2  # both signs of h, of a width of 2
    F = fresnel(eta, c * np.cos(gamma))
    sin_t = np.sin(gamma) / bravais
    T = np.exp(-sigma * 2 * np.sqrt(1 - sin_t**2) / math.sqrt(1 - (s / eta) ** 2))
    if lobe == 3:
        energy = float(np.sum(weight * (1 - F) ** 2 * F**2 * T**3 / (1 - F * T)))
        return energy, energy / 2
    A = F if lobe == 0 else (1 - F) ** 2 * F ** (lobe - 1) * T**lobe
    wrapped = np.abs(np.remainder(phi(lobe, gamma) + math.pi, 2 * math.pi) - math.pi)
    return float(np.sum(weight * A)), float(np.sum(weight * A * wrapped) / math.pi)


def lobe_energies(eta, sigma, shift, width, theta_i):
    """[lobe][forward, backward]"""
    shifts, widths = shifts_and_widths(shift, width)
    sums = np.zeros((4, 2))
    for lobe in range(4):
        centre, deviation = 2 * shifts[lobe] - theta_i, 2 * widths[lobe]
        first, last = max(-math.pi / 2, centre - 9.5 * deviation), min(math.pi / 2, centre + 9.5 * deviation)
        edges = {first, last}
        # where eta' = 2 the first crossing of TRT appears
        kink = math.acos(math.sqrt((eta * eta - 1) / 3)) if eta < 2 else 0
        for edge in (centre, theta_i + 2 * kink, theta_i - 2 * kink):
            if first < edge < last:
                edges.add(edge)
        theta_o, weight = rule(sorted(edges), 6)
        for t, w in zip(theta_o, weight):
            theta_h, theta_d = (t + theta_i) / 2, (t - theta_i) / 2
            kernel = 0.5 * math.exp(-((theta_h - shifts[lobe]) ** 2) / (2 * widths[lobe] ** 2)) / math.sqrt(
                2 * math.pi * widths[lobe] ** 2)
            energy, forward = azimuth_energy(lobe, eta, sigma, theta_d)
            factor = w * kernel * (math.cos(t) / math.cos(theta_d)) ** 2
            sums[lobe] += factor * np.array([forward, energy - forward])
    return sums


def averages(sums, shift, width):
    """Of as many lobes as there are rows."""
    shifts, widths = shifts_and_widths(shift, width)
    a_f, a_b = sums.sum(axis=0)
    means = lambda values: [float((sums[:, k] * np.array(values[:len(sums)])).sum() / sums[:, k].sum()) for k in (0, 1)]
    alpha_f, alpha_b = means(shifts)
    beta_f, beta_b = means(widths)
    return {"a_f": float(a_f), "a_b": float(a_b), "alpha_f": alpha_f, "alpha_b": alpha_b, "beta_f": beta_f,
            "beta_b": beta_b}


def ladder(v):
    a_f, a_b, x = mp.mpf(v["a_f"]), mp.mpf(v["a_b"]), mp.mpf(v["a_f"]) ** 2
    corrected = {
        "A_b": a_b * x / (1 - x) + a_b**3 * x / (1 - x) ** 3,
        "Delta_b": v["alpha_b"] * (1 + 2 * a_b**2 / (1 - x) ** 2)
                   + v["alpha_f"] * (2 * (1 - x) ** 2 + 4 * x * a_b**2) / (1 - x) ** 3,
        "sigma_b": (1 + mp.mpf("0.7") * x) * (a_b * mp.sqrt(2 * v["beta_f"]**2 + v["beta_b"]**2)
                   + a_b**3 * mp.sqrt(2 * v["beta_f"]**2 + 3 * v["beta_b"]**2)) / (a_b + a_b**3)}
    return {key: float(value) for key, value in corrected.items()}


# ---- values ---------------------------------------------------------------------------------------------------------

def mp_fresnel(eta, cosine):
    inner = mp.sqrt(eta**2 - 1 + cosine**2)
    s = (cosine - inner) / (cosine + inner)
    p = (eta**2 * cosine - inner) / (eta**2 * cosine + inner)
    return (s * s + p * p) / 2


def mp_azimuthal(p, eta, sigma, theta_d, phi):
    bravais = mp.sqrt(eta**2 - mp.sin(theta_d)**2) / mp.cos(theta_d)
    along = 1 / mp.sqrt(1 - (mp.sin(theta_d) / eta) ** 2)
    exit = lambda h: 2 * p * mp.asin(h / bravais) - 2 * mp.asin(h) + p * mp.pi
    grid = [-mp.cos(mp.pi * k / 401) for k in range(402)]
    exits = [exit(h) for h in grid]
    total = mp.mpf(0)
    for turn in range(-2, 4):
        miss = lambda h: exit(h) - phi - 2 * mp.pi * turn
        values = [e - phi - 2 * mp.pi * turn for e in exits]
        for a, b, fa, fb in zip(grid[:-1], grid[1:], values[:-1], values[1:]):
            if fa * fb >= 0:
                continue
            for _ in range(140):
                c = (a + b) / 2
                fc = miss(c)
                if fa * fc <= 0:
                    b, fb = c, fc
                else:
                    a, fa = c, fc
            h = (a + b) / 2
            F = mp_fresnel(eta, mp.cos(theta_d) * mp.sqrt(1 - h * h))
            T = mp.exp(-sigma * 2 * mp.sqrt(1 - (h / bravais) ** 2) * along)
            A = F if p == 0 else (1 - F) ** 2 * F ** (p - 1) * T**p
            slope = 2 * p / mp.sqrt(bravais**2 - h * h) - 2 / mp.sqrt(1 - h * h)
            total += A / abs(2 * slope)
    return total


def hair(case, theta_i, theta_o, phi):
    shifts, widths = shifts_and_widths(mp.mpf(case["shift"]), mp.mpf(case["width"]))
    theta_i, theta_o, phi = mp.mpf(theta_i), mp.mpf(theta_o), mp.mpf(phi)
    theta_h, theta_d = (theta_i + theta_o) / 2, (theta_o - theta_i) / 2
    value = []
    for sigma in case["sigma_a"]:
        total = mp.mpf(0)
        for p in range(3):
            M = mp.exp(-(theta_h - shifts[p]) ** 2 / (2 * widths[p]**2)) / mp.sqrt(2 * mp.pi * widths[p]**2) / 2
            total += M * mp_azimuthal(p, mp.mpf(case["eta"]), mp.mpf(sigma), theta_d, phi) / mp.cos(theta_d) ** 2
        value.append(float(total))
    return value


def artist(case, theta_i, theta_o, phi):
    theta_i, theta_o, phi = mp.mpf(theta_i), mp.mpf(theta_o), mp.mpf(phi)
    theta_h, theta_d = (theta_i + theta_o) / 2, (theta_o - theta_i) / 2
    unit = lambda width, x: mp.exp(-x * x / (2 * mp.mpf(width) ** 2))
    around = abs(phi)
    N = [mp.cos(phi / 2), unit(case["gamma_TT"], mp.pi - around),
         mp.cos(phi / 2) + case["I_g"] * unit(case["gamma_g"], case["G"] - around)]
    value = [mp.mpf(0)] * 3
    for k, lobe in enumerate(("R", "TT", "TRT")):
        C, intensity, shift, width = case[lobe]
        M = unit(width, theta_h - mp.mpf(shift))
        for c in range(3):
            value[c] += mp.mpf(C[c]) * intensity * M * N[k] / mp.cos(theta_d) ** 2
    return value


def artist_energy(case, theta_i):
    """Integral of f' cos theta_o d omega. Each lobe is a function of theta_o times one of phi."""
    theta_i = mp.mpf(theta_i)
    unit = lambda width, x: mp.exp(-x * x / (2 * mp.mpf(width) ** 2))
    ends = [-mp.pi / 2] + [mp.pi * k / 24 for k in range(-11, 12)] + [mp.pi / 2]
    circle = [mp.pi * k / 12 for k in range(13)]
    N = [lambda f: mp.cos(f / 2), lambda f: unit(case["gamma_TT"], mp.pi - f),
         lambda f: mp.cos(f / 2) + case["I_g"] * unit(case["gamma_g"], case["G"] - f)]
    total = [mp.mpf(0)] * 3
    with mp.workdps(22):
        for k, lobe in enumerate(("R", "TT", "TRT")):
            C, intensity, shift, width = case[lobe]
            centre = 2 * mp.mpf(shift) - theta_i
            edges = sorted(ends + [e for e in (centre - 6 * width, centre, centre + 6 * width) if abs(e) < mp.pi / 2])
            along = mp.quad(lambda t: unit(width, (theta_i + t) / 2 - mp.mpf(shift)) * mp.cos(t) ** 2
                            / mp.cos((t - theta_i) / 2) ** 2, edges)
            across = 2 * mp.quad(N[k], circle)
            for c in range(3):
                total[c] += mp.mpf(C[c]) * intensity * along * across
    return [float(t) for t in total]


def main():
    rad = math.radians
    truth = {"assembly": [], "values": [], "artist": []}
    for eta, sigma, shift, width in ((1.55, 0.2, -5, 7.5), (1.55, 0.5, -5, 7.5), (1.55, 0.0, -10, 5), (1.4, 2.0, -7, 10)):
        for theta_i in (-60, -30, 0, 30, 60, 80):
            sums = lobe_energies(eta, sigma, rad(shift), rad(width), rad(theta_i))
            for lobes in (3, 4):
                v = averages(sums[:lobes], rad(shift), rad(width))
                truth["assembly"].append({"eta": eta, "sigma_a": sigma, "shift": rad(shift), "width": rad(width),
                                          "theta_i": rad(theta_i), "lobes": lobes, **v, **ladder(v)})
    case = {"eta": ETA, "sigma_a": [0.2, 0.3, 0.5], "shift": -0.09, "width": 0.13}
    at = [(0.3, -0.4, 0.1), (0.3, -0.4, 0.3), (-0.2, 0.1, 3.0), (0.7, -0.8, 1.7), (1.2, -1.0, 2.5), (-1.4, 1.3, 0.05),
          (0, 0, 0.2), (0.0, 0.02, -0.31), (0.5, 0.3, -2.9), (1.5, -1.45, 2.0)]
    truth["values"].append({**case, "at": at, "f": [hair(case, *a) for a in at]})
    artists = [
        {"R": [[1, 0.9, 0.8], 0.6, -0.09, 0.12], "TT": [[0.9, 0.6, 0.3], 1.5, 0.045, 0.06],
         "TRT": [[0.7, 0.5, 0.2], 0.5, 0.13, 0.25], "gamma_TT": 0.3, "I_g": 0.7, "gamma_g": 0.09, "G": 0.62},
        {"R": [[0, 2, 1], 3, 0.2, 0.02], "TT": [[1, 1, 0], 0.1, -0.3, 0.5],
         "TRT": [[0.1, 0.2, 0.3], 5, 0, 1.2], "gamma_TT": 1.1, "I_g": 0, "gamma_g": 0.4, "G": 0.55}]
    for case in artists:
        directions = at + [(-0.6, 0.5, 0.62), (0.1, -0.2, math.pi)]
        inclinations = [-1.2, -0.4, 0.0, 0.8]
        truth["artist"].append({**case, "at": directions, "f": [[float(x) for x in artist(case, *a)] for a in directions],
                                "theta_i": inclinations, "energy": [artist_energy(case, t) for t in inclinations]})
    path = pathlib.Path(__file__).with_name("hair_truth.json")
    path.write_text(json.dumps(truth, indent=1) + "\n")


if __name__ == "__main__":
    main()
