#!/usr/bin/env python3
"""Makes mie_truth.json: Lorenz-Mie scattering by the textbook formulas in high precision.

Usage: make_mie_truth.py > mie_truth.json     (needs mpmath; gmpy2 makes it fast: about five minutes)
       make_mie_truth.py --decimal > mie_decimal_truth.json

Nothing here is shared with the library's method: Bohren & Huffman (1983) eqs. 4.53, 4.61, 4.62, 4.74 and 4.47 as they
stand, all functions by upward recurrence, with as many guard digits as the recurrence can lose. Sizes, indices and
angles (degrees) are the exact values of their doubles; with --decimal, angles are decimals, as they are written.
"""
import cmath
import json
import math
import sys

from mpmath import mp, mpc, mpf

ANGLES = [0, 1e-3, 0.1, 0.5, 10, 45, 60, 89.9, 90, 90.1, 120, 137.5, 138, 150, 179.9, 179.999, 180]
# No double is equal to one of these.
DECIMALS = ["0.1", "7.3", "59.9", "89.9", "90.1", "120.7", "137.9", "138.3", "165.7", "179.3", "179.9"]
FEW = [0, 1e-3, 0.5, 45, 90, 131.25, 137.5, 138, 165, 179.999, 180]


def lost_digits(order, argument):
    """Digits that upward recurrence of psi loses: twice the growth of the other solution, exp(Re integral of acosh)."""
    steps = 2000
    growth = sum(abs(cmath.acosh(order * (i + 0.5) / steps / complex(argument)).real) for i in range(steps))
    return int(2 * growth * order / steps / math.log(10)) + 1


def riccati(z, count, sine_like):
    """psi_n = z j_n (sine_like) or chi_n = -z y_n, n = 0..count."""
    s, c = mp.sin(z), mp.cos(z)
    values = [s, s / z - c] if sine_like else [c, c / z + s]
    for n in range(1, count):
        values.append((2 * n + 1) / z * values[n] - values[n - 1])
    return values


def coefficients(x, m):
    count = int(x + 14 * x ** (1 / 3) + 20)
    mp.dps = 60 + max(lost_digits(count, x), lost_digits(count, m * x))
    X, M = mpf(x), mpc(m) if m.imag else mpf(m.real)
    z = M * X
    psi, chi, inner = riccati(X, count, True), riccati(X, count, False), riccati(z, count, True)
    a, b = [], []
    for n in range(1, count + 1):
        p, dp = psi[n], psi[n - 1] - n * psi[n] / X
        xi = mpc(p, -chi[n])
        dxi = mpc(dp, -(chi[n - 1] - n * chi[n] / X))
        q, dq = inner[n], inner[n - 1] - n * inner[n] / z
        a.append((M * q * dp - p * dq) / (M * q * dxi - xi * dq))
        b.append((q * dp - M * p * dq) / (q * dxi - M * xi * dq))
    mp.dps = 60
    return [+v for v in a], [+v for v in b]


def amplitudes(a, b, degrees):
    mu = mp.cos(mpf(degrees) * mp.pi / 180)
    s1 = s2 = mpc(0)
    before, pi = mpf(0), mpf(1)
    for n in range(1, len(a) + 1):
        tau = n * mu * pi - (n + 1) * before
        factor = mpf(2 * n + 1) / (n * (n + 1))
        s1 += factor * (a[n - 1] * pi + b[n - 1] * tau)
        s2 += factor * (a[n - 1] * tau + b[n - 1] * pi)
        before, pi = pi, ((2 * n + 1) * mu * pi - (n + 1) * before) / n
    return s1, s2


def number(value):
    return float(mp.nstr(value, 20))


def case(name, x, m, angles):
    print(name, file=sys.stderr, flush=True)
    m = complex(m)
    a, b = coefficients(x, m)
    X = mpf(x)
    ext = sca = asymmetry = mpf(0)
    back = mpc(0)
    for i, (u, v) in enumerate(zip(a, b)):
        n = i + 1
        ext += (2 * n + 1) * (u + v).real
        sca += (2 * n + 1) * (abs(u) ** 2 + abs(v) ** 2)
        back += (2 * n + 1) * (-1) ** n * (u - v)
        asymmetry += mpf(2 * n + 1) / (n * (n + 1)) * (u * mp.conj(v)).real
        if n < len(a):
            asymmetry += mpf(n * (n + 2)) / (n + 1) * (u * mp.conj(a[n]) + v * mp.conj(b[n])).real
    scale = 2 / X**2
    s = [amplitudes(a, b, t) for t in angles]
    absorbed = ext - sca if m.imag else mpf(0)
    return {
        "name": name, "x": x, "m": [m.real, m.imag],
        "Qext": number(scale * ext), "Qsca": number(scale * sca), "Qabs": number(scale * absorbed),
        "Qback": number(abs(back) ** 2 / X**2), "g": number(2 * asymmetry / sca),
        "theta_deg": angles,
        "S1": [[number(u.real), number(u.imag)] for u, _ in s],
        "S2": [[number(v.real), number(v.imag)] for _, v in s],
    }


def resonance(x, m, order):
    """The double nearest to the peak of b_order: Re b = 1, where the imaginary part changes sign."""
    def imaginary(value):
        count = order + 40
        mp.dps = 120
        X, M = mpf(value), mpf(m)
        psi, chi, inner = riccati(X, count, True), riccati(X, count, False), riccati(M * X, count, True)
        n = order
        dchi = chi[n - 1] - n * chi[n] / X
        dq = inner[n - 1] - n * inner[n] / (M * X)
        return inner[n] * dchi - M * chi[n] * dq
    root = mp.findroot(imaginary, (x - 1e-4, x + 1e-4), solver="anderson", tol=1e-60)
    return float(root)


def main():
    pi = 3.141592653589793
    peak = resonance(49.9386, 1.5, 68)
    cases = [
        ("smallest", 1e-6, 1.33, ANGLES),
        ("smallest, absorbing", 1e-6, 1.5 + 0.1j, ANGLES),
        ("small, hardly absorbing", 1e-3, 1.33 + 1e-9j, ANGLES),
        ("small, dense", 0.1, 10 + 10j, ANGLES),
        ("small metal", 0.5, 0.2 + 3j, ANGLES),
        ("index near 1, small", 1.0, 1.0001, ANGLES),
        ("high index", 1.0, 10, ANGLES),
        ("pi", pi, 1.33, ANGLES),
        ("ten pi", 10 * pi, 1.333, ANGLES),
        ("beside a narrow resonance", 49.9386, 1.5, ANGLES),
        ("on a narrow resonance", peak, 1.5, ANGLES),
        ("bubble", 100.0, 0.75, ANGLES),
        ("absorbing", 100.0, 1.5 + 0.1j, ANGLES),
        ("hundred pi", 100 * pi, 1.5, ANGLES),
        ("large bubble", 1000.0, 0.75, ANGLES),
        ("fog, hardly absorbing", 1000.0, 1.33 + 1e-9j, ANGLES),
        ("dense", 1000.0, 10 + 10j, ANGLES),
        ("drop of 0.4 mm at 650 nm", 3866.6, 1.331, ANGLES),
        ("index near 1", 5000.0, 1.0001, ANGLES),
        ("thousand pi", 1000 * pi, 1.333, ANGLES),
        ("largest", 50000.0, 1.333, FEW),
        ("largest, hardly absorbing", 50000.0, 1.33 + 1e-9j, FEW),
        ("largest, dense", 50000.0, 10 + 10j, FEW),
        ("largest, index near 1", 50000.0, 1.0001, FEW),
    ]
    if sys.argv[1:] == ["--decimal"]:
        cases = [(name, x, m, DECIMALS) for name, x, m, _ in cases if x >= 100]
    # The big ones are independent: a pool only saves time.
    from multiprocessing import Pool
    with Pool() as pool:
        results = pool.starmap(case, cases, chunksize=1)
    print("[")
    print(",\n".join(json.dumps(r) for r in results))
    print("]")


if __name__ == "__main__":
    main()
