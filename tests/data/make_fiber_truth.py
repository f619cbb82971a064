#!/usr/bin/env python3
"""Makes fiber_truth.json: ray optics of a dielectric cylinder, evaluated independently of the library.

Usage: make_fiber_truth.py > fiber_truth.json     (needs mpmath; gmpy2 makes it fast: about ten minutes of one core)

Nothing here is shared with the library's method. Rays are traced in three dimensions against the cylinder: vectors are
refracted by Snell's law (no Bravais index), carry electric fields through Fresnel's coefficients (sines and cosines of
the angles), and leave at the azimuth of their direction. The rays toward an azimuth are found by sampling the offset h
densely and bisecting, their density by a numerical derivative, energies and moments by quadrature over h, split where
the sampled azimuth crosses a kink. Indices, angles (radians) and absorption are the exact values of their doubles.
"""
import json
import math
import sys

from mpmath import mp, mpf

mp.dps = 36


def dot(a, b):
    return sum(x * y for x, y in zip(a, b))


def add(a, b, scale=1):
    return [x + scale * y for x, y in zip(a, b)]


def times(s, a):
    return [s * x for x in a]


def cross(a, b):
    return [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]


def unit(a):
    return times(1 / mp.sqrt(dot(a, a)), a)


def coefficients(n1, n2, c1, c2):
    """Fresnel's amplitudes r_s, r_p (right-handed frames) and the transmitted energies' square roots."""
    r_s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2)
    r_p = (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)
    scale = mp.sqrt(n2 * c2 / (n1 * c1))
    return r_s, r_p, scale * 2 * n1 * c1 / (n1 * c1 + n2 * c2), scale * 2 * n1 * c1 / (n2 * c1 + n1 * c2)


def interact(d, fields, normal, n1, n2):
    """normal against d. Directions and fields of the reflected and of the refracted ray, and the mean F."""
    c1 = -dot(d, normal)
    ratio = n1 / n2
    c2 = mp.sqrt(max(1 - ratio ** 2 * (1 - c1 ** 2), 0))  # below 0 by rounding only, at grazing exit
    reflected = add(d, normal, 2 * c1)
    refracted = add(times(ratio, d), normal, ratio * c1 - c2)
    s = cross(d, normal)
    if dot(s, s) < mpf(10) ** (-2 * mp.dps + 20):
        s = cross(d, [0, 0, 1] if abs(d[2]) < 0.9 else [0, 1, 0])
    s = unit(s)
    r_s, r_p, t_s, t_p = coefficients(n1, n2, c1, c2)
    # p = direction x s for each ray: right-handed (p, s, direction) turned over alike for all
    p_in, p_reflected, p_refracted = cross(d, s), cross(reflected, s), cross(refracted, s)
    # H-continuity gives the reflected p the sign +r_p in these frames where r_p = (n2 c1 - n1 c2) / (...)
    back = [add(times(r_s * dot(f, s), s), p_reflected, r_p * dot(f, p_in)) for f in fields]
    on = [add(times(t_s * dot(f, s), s), p_refracted, t_p * dot(f, p_in)) for f in fields]
    return reflected, back, refracted, on, (r_s ** 2 + r_p ** 2) / 2


class Fiber:
    def __init__(self, eta, sigma_a, theta_d, tracked):
        self.eta, self.sigma_a, self.theta_d, self.tracked = mpf(eta), mpf(sigma_a), mpf(theta_d), tracked

    def trace(self, h, p):
        """(turn from the direction back to the light, in (-pi, pi]; A_p) of the ray at the offset h."""
        h = mpf(h)
        c = mp.sqrt(1 - h * h)
        if c == 0:
            return mpf(0), mpf(0)  # quadrature's last nodes; their weight d h is zero
        # Light comes from +x (tilted) and travels toward -x; offset along y with the sign of phi_0 = -2 asin h.
        d = [-mp.cos(self.theta_d), mpf(0), mp.sin(self.theta_d)]
        at = [c, -h, mpf(0)]
        fields = [unit(cross(d, [0, 1, 0])), [mpf(0), mpf(1), mpf(0)]]
        reflected, back, inside, on, F = interact(d, fields, [at[0], at[1], 0], mpf(1), self.eta)
        if p == 0:
            out, fields, energy = reflected, back, F
        else:
            energy = 1 - F
            d, fields, depth = inside, on, mpf(0)
            for k in range(p):
                across = dot([d[0], d[1]], [d[0], d[1]])
                length = -2 * (d[0] * at[0] + d[1] * at[1]) / across
                depth += length
                at = [at[0] + length * d[0], at[1] + length * d[1], mpf(0)]
                r = mp.sqrt(at[0] ** 2 + at[1] ** 2)
                reflected, back, out, on, F = interact(d, fields, [-at[0] / r, -at[1] / r, 0], self.eta, mpf(1))
                if k < p - 1:
                    d, fields, energy = reflected, back, energy * F
                else:
                    fields, energy = on, energy * (1 - F)
            lost = mp.exp(-self.sigma_a * depth)
            energy *= lost
            fields = [times(mp.sqrt(lost), f) for f in fields]
        phi = mp.atan2(out[1], out[0])
        if self.tracked:
            energy = sum(dot(f, f) for f in fields) / 2
        return phi, energy

    def azimuth(self, h, p):
        return self.trace(h, p)[0]


def samples(p):
    """Offsets, denser toward the rims."""
    count = 80 + 40 * p
    rim = mp.sin(mp.pi / 2 * (1 - mpf(10) ** -12))
    return [-rim] + [mp.sin(mp.pi * (mpf(i) / count - mpf(1) / 2)) for i in range(1, count)] + [rim]


def wrapped(a):
    return a - 2 * mp.pi * mp.nint(a / (2 * mp.pi))


def bisect(f, a, b):
    """A root between a and b, where f changes its sign: by bisection, then by the Illinois variant of false position."""
    fa, fb = f(a), f(b)
    for step in range(400):
        m = (a + b) / 2 if step < 4 else (a * fb - b * fa) / (fb - fa)
        fm = f(m)
        if fm == 0 or abs(b - a) < mpf(10) ** (4 - mp.dps) or m in (a, b):
            return m
        if (fm > 0) == (fb > 0):
            fa /= 2 if step >= 4 else 1
        else:
            a, fa = b, fb
        b, fb = m, fm
    raise ArithmeticError("no convergence")


def stationary(fiber, p, table):
    """Offsets where the azimuth turns round, found between samples by golden sections of a parabola: bisecting the slope."""
    found = []
    slope = lambda h: mp.diff(lambda x: wrapped(fiber.azimuth(x, p) - fiber.azimuth(h, p)), h, h=mpf(10) ** -12)
    signs = [slope(h) > 0 for h, _ in table]
    for (a, _), (b, _), sa, sb in zip(table, table[1:], signs, signs[1:]):
        if sa != sb:
            found.append(bisect(slope, a, b))
    return found


def distribution(fiber, p, phi, offsets, values):
    total = mpf(0)
    f = lambda h: wrapped(fiber.azimuth(h, p) - phi)
    g = [wrapped(v - phi) for v in values]
    for a, b, ga, gb in zip(offsets, offsets[1:], g, g[1:]):
        if gb == 0:
            continue  # counted from the sample's other side
        if ga == 0 or (ga > 0) != (gb > 0):
            if abs(ga) + abs(gb) > 3:
                continue  # jump of the wrapping
            h = bisect(f, a, b)
            slope = mp.diff(f, h, h=mpf(10) ** -13)
            total += fiber.trace(h, p)[1] / abs(2 * slope)
    return total


def moments(fiber, p, offsets, values):
    cuts = []
    for kink in (mpf(0), mp.pi / 2, -mp.pi / 2, mp.pi):
        f = lambda h: wrapped(fiber.azimuth(h, p) - kink)
        g = [wrapped(v - kink) for v in values]
        for a, b, ga, gb in zip(offsets, offsets[1:], g, g[1:]):
            if (ga > 0) != (gb > 0) and abs(ga) + abs(gb) < 3:
                cuts.append(mp.asin(bisect(f, a, b)))
    cuts = sorted([-mp.pi / 2, mp.pi / 2] + cuts + [mpf(0)])
    cuts = [a for i, a in enumerate(cuts) if i == 0 or a - cuts[i - 1] > mpf(10) ** -20]

    # The double-exponential rule on each piece, all three moments from the same rays.
    total = [mpf(0)] * 3
    for a, b in zip(cuts, cuts[1:]):
        middle, half = (a + b) / 2, (b - a) / 2
        forward = abs(fiber.azimuth(mp.sin(middle), p)) > mp.pi / 2
        for x, weight in RULE:
            gamma = middle + half * x
            phi, energy = fiber.trace(mp.sin(gamma), p)
            share = energy * mp.cos(gamma) / 2 * half * weight
            total[0] += share
            total[1] += share * abs(phi) / mp.pi
            total[2] += share if forward else 0
    return total


STEP = mpf(1) / 14
RULE = [(mp.tanh(mp.pi / 2 * mp.sinh(k * STEP)), STEP * mp.pi / 2 * mp.cosh(k * STEP) / mp.cosh(mp.pi / 2 * mp.sinh(k * STEP)) ** 2) for k in range(-46, 47)]


def main():
    degree = math.pi / 180
    fibers = [
        (1.55, 0.0, 0.0, False, range(0, 5)),
        (1.55, 0.2, 30 * degree, False, [0, 1, 2, 3, 8]),
        (1.55, 0.5, -46.5 * degree, False, [1, 2, 3]),
        (1.55, 0.1, 47.5 * degree, False, [2, 3]),
        (1.55, 0.3, 85 * degree, False, [0, 1, 2, 5]),
        (1.345, 0.0, 20 * degree, False, [1, 2, 4, 7]),
        (1.02, 0.05, 10 * degree, False, [0, 1, 2]),
        (2.4, 3.0, 10 * degree, False, [1, 2, 3]),
        (1.55, 0.0, 0.0, True, [0, 1, 2, 3]),
        (1.55, 0.2, 40 * degree, True, [0, 1, 2, 3, 5]),
        (1.4, 0.0, -80 * degree, True, [1, 2, 4]),
    ]
    cases = []
    for eta, sigma_a, theta_d, tracked, orders in fibers:
        fiber = Fiber(eta, sigma_a, theta_d, tracked)
        for p in orders:
            offsets = samples(p)
            values = [fiber.azimuth(h, p) for h in offsets]
            caustics = []
            if p >= 2:
                positive = [(h, v) for h, v in zip(offsets, values) if 0 < h < offsets[-1]]
                caustics = [abs(fiber.azimuth(h, p)) for h in stationary(fiber, p, positive)]
            phis = [0.0, 0.1, 0.37, 1.0, 1.7, 2.5, 3.0, 3.14, -0.9]
            for c in caustics:
                phis += [float(c) + s * e for s in (1, -1) for e in (1e-2, 1e-4, 1e-6)]
            # beside the caustic two offsets nearly meet: samples between them see both
            grid = list(zip(offsets, values))
            if caustics:
                tops = stationary(fiber, p, positive)
                extra = [s * t for t in tops for s in (1, -1)]
                grid = sorted(grid + [(h, fiber.azimuth(h, p)) for h in extra])
            hs, vs = [h for h, _ in grid], [v for _, v in grid]
            row = {
                "eta": eta, "sigma_a": sigma_a, "theta_d": theta_d, "tracked": tracked, "order": p,
                "caustics": [float(c) for c in caustics],
                "phi": phis,
                "N": [float(distribution(fiber, p, mpf(phi), hs, vs)) for phi in phis],
                "moments": [float(m) for m in moments(fiber, p, hs, vs)],
            }
            cases.append(row)
            print(eta, theta_d, p, row["caustics"], row["moments"], file=sys.stderr, flush=True)
    json.dump({"made_by": "make_fiber_truth.py", "cases": cases}, sys.stdout, indent=1)


main()
