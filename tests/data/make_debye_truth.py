#!/usr/bin/env python3
"""Makes debye_truth.json: the Debye series of spheres by the textbook formulas in high precision.

Usage: make_debye_truth.py > debye_truth.json     (needs mpmath; gmpy2 makes it fast: about five minutes)

Nothing here is shared with the library's method. Every partial wave's reflection and transmission at the two sides of
the surface solve the boundary conditions of one incoming wave with spherical Hankel functions and their derivatives as
they stand (Hovenac & Lock 1992, J. Opt. Soc. Am. A 9, 781), from psi and chi by upward recurrence with as many guard
digits as it can lose:
    a_n, b_n = 1/2 [1 - R22 - sum over p >= 1 of T21 R11^(p-1) T12].
"S1", "S2" are the whole sphere's, from Bohren & Huffman's a_n and b_n, 4.53; "remainder" is the whole less the terms
0 .. the last, term by term. Sizes, indices and angles (degrees) are the exact values of their doubles.
"""
import json
import sys

from mpmath import mp, mpc, mpf

from make_mie_truth import amplitudes, lost_digits, number, riccati

ANGLES = [0, 1e-3, 0.5, 10, 45, 60, 82, 90, 90.1, 110, 125, 130, 137.5, 138, 150, 165, 179.9, 179.999, 180]
FEW = [0, 0.5, 25, 60, 90, 100, 128, 134, 138, 150, 170, 179.999, 180]


def surface(outside, inside, alpha, beta, m):
    """R22, T21 T12, R11 of one polarisation, and a_n or b_n.

    outside, inside: (psi, psi', chi, chi') of x and of m x. A field f outside meets g inside where alpha-weighted
    values and derivatives agree: alpha f' g - beta f g' = 0 (alpha, beta = m, 1 for a_n and 1, m for b_n).
    """
    def hankel(p, dp, c, dc, sign):
        return p - sign * 1j * c, dp - sign * 1j * dc

    h1, dh1 = hankel(*outside, 1)
    h2, dh2 = hankel(*outside, -1)
    k1, dk1 = hankel(*inside, 1)
    k2, dk2 = hankel(*inside, -1)
    # Outside h2 + R22 h1, inside T21 k2; then inside k1 + R11 k2, outside T12 h1. Continuous are (f beta, alpha f')
    # outside and (g alpha, beta g' ) inside, up to a common factor.
    common = alpha * dh1 * k2 - beta * h1 * dk2
    r22 = (beta * h2 * dk2 - alpha * dh2 * k2) / common
    t21 = beta * (h2 + r22 * h1) / (alpha * k2)
    r11 = (beta * h1 * dk1 - alpha * dh1 * k1) / common
    t12 = alpha * (k1 + r11 * k2) / (beta * h1)
    p, dp = outside[:2]
    q, dq = inside[:2]
    whole = (alpha * q * dp - beta * p * dq) / (alpha * q * dh1 - beta * h1 * dq)
    return r22, t21 * t12, r11, whole


def coefficients(x, m, orders):
    """Per set of coefficients ("whole", each order, "remainder") the lists a_n, b_n."""
    count = int(x + 14 * x ** (1 / 3) + 20)
    mp.dps = int(90 + lost_digits(count, x) + lost_digits(count, m * x) + 2 * (m * x).imag)
    X, M = mpf(x), mpc(m) if m.imag else mpf(m.real)
    z = M * X
    psi, chi = riccati(X, count, True), riccati(X, count, False)
    inner_psi, inner_chi = riccati(z, count, True), riccati(z, count, False)
    sets = {key: ([], []) for key in ["whole", *orders, "remainder"]}

    def with_derivatives(p, c, n, argument):
        return p[n], p[n - 1] - n * p[n] / argument, c[n], c[n - 1] - n * c[n] / argument

    for n in range(1, count + 1):
        outside = with_derivatives(psi, chi, n, X)
        inside = with_derivatives(inner_psi, inner_chi, n, z)
        for which, (alpha, beta) in enumerate([(M, 1), (1, M)]):
            r22, t, r11, whole = surface(outside, inside, alpha, beta, M)
            sets["whole"][which].append(whole)
            term, rest = (1 - r22) / 2, whole
            factor = -t / 2
            for p in range(orders[-1] + 1):
                if p in sets:
                    sets[p][which].append(term)
                rest -= term
                term = factor
                factor *= r11
            sets["remainder"][which].append(rest)
    mp.dps = 60
    return {key: tuple([+v for v in values] for values in pair) for key, pair in sets.items()}


def case(name, x, m, orders, angles):
    m = complex(m)
    sets = coefficients(x, m, orders)
    result = {"name": name, "x": x, "m": [m.real, m.imag], "theta_deg": angles, "orders": []}
    for key, (a, b) in sets.items():
        s = [amplitudes(a, b, t) for t in angles]
        S1 = [[number(u.real), number(u.imag)] for u, _ in s]
        S2 = [[number(v.real), number(v.imag)] for _, v in s]
        if key == "whole":
            result |= {"S1": S1, "S2": S2}
        elif key == "remainder":
            result["remainder"] = {"S1": S1, "S2": S2}
        else:
            result["orders"].append({"p": key, "S1": S1, "S2": S2})
    print(name, file=sys.stderr, flush=True)
    return result


def main():
    few, many = [0, 1, 2, 3], list(range(9))
    cases = [
        ("tiny", 1e-6, 1.33, few, FEW),
        ("small", 0.1, 1.5, few, FEW),
        ("small metal", 0.5, 0.2 + 3j, few, FEW),
        ("one", 1.0, 1.333, few, FEW),
        ("high index", 1.0, 10, few, FEW),
        ("ten", 10.0, 1.333, many, ANGLES),
        ("beside a narrow resonance", 49.9386, 1.5, [0, 1, 2, 3, 30], FEW),
        ("bubble", 100.0, 0.75, few, ANGLES),
        ("absorbing", 100.0, 1.5 + 0.1j, few, FEW),
        ("thin bubble", 300.0, 0.2, few, FEW),
        ("thousand", 1000.0, 1.333, many, ANGLES),
        ("thousand, hardly absorbing", 1000.0, 1.33 + 1e-9j, [2, 100], FEW),
        ("thousand, absorbing", 1000.0, 1.33 + 1e-3j, few, FEW),
        ("dense", 1000.0, 10 + 10j, few, FEW),
        ("large bubble", 1000.0, 0.75, few, FEW),
        ("index near 1", 5000.0, 1.0001, few, FEW),
        ("drop", 5000.0, 1.333, [0, 1, 2, 3, 4], ANGLES),
        ("largest", 20000.0, 1.333, many, ANGLES),
        ("largest, absorbing", 20000.0, 1.33 + 1e-5j, [0, 1, 2, 3, 11], FEW),
        ("largest bubble", 20000.0, 0.75, few, FEW),
    ]
    # The big ones first, in a pool, only to save time.
    from multiprocessing import Pool
    with Pool() as pool:
        order = sorted(range(len(cases)), key=lambda i: -cases[i][1])
        results = dict(zip(order, pool.starmap(case, [cases[i] for i in order], chunksize=1)))
    print("[")
    print(",\n".join(json.dumps(results[i]) for i in range(len(cases))))
    print("]")


if __name__ == "__main__":
    main()
