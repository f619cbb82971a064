#!/usr/bin/env python3
"""Makes cylinder_truth.json: scattering by an infinite circular cylinder straight from Maxwell's equations.

Usage: make_cylinder_truth.py > cylinder_truth.json     (needs mpmath; gmpy2 makes it fast: about four minutes of two cores)

Nothing here is shared with the library's method. For every order n the four boundary conditions (E_z, H_z, E_phi and
H_phi continuous) are a linear system that is solved as it stands, and the amplitudes follow from the far field and
the definition of T1..T4 (Bohren & Huffman 1983, 8.34). Their closed formulas, p. 201, are computed beside and must
agree. A Debye term is a chain of such systems: the wave H^(2) comes in, is reflected and refracted, crosses the axis
to become H^(1), and so on. Bessel functions come by upward recurrence with as many guard digits as it can lose. Sizes,
indices and angles (degrees) are the exact values of their doubles.
"""
import cmath
import json
import math
import sys

from mpmath import mp, mpc, mpf

DIGITS = 50
ANGLES = [0, 1e-3, 0.5, 10, 45, 89.9, 90, 131.25, 137.5, 160, 179.9, 180, 222.5, 359.5]


def lost_digits(order, argument):
    """Digits that upward recurrence of J loses: twice the growth of the other solution, exp(Re integral of acosh)."""
    steps = 2000
    growth = sum(abs(cmath.acosh(order * (i + 0.5) / steps / complex(argument)).real) for i in range(steps))
    return int(2 * growth * order / steps / math.log(10)) + 1


def upward(function, z, count):
    """[(f_n, f_n')], n = 0..count-1."""
    values = [function(0, z), function(1, z)]
    for n in range(1, count):
        values.append(2 * n / z * values[n] - values[n - 1])
    return [(values[0], -values[1])] + [(values[n], values[n - 1] - n / z * values[n]) for n in range(1, count)]


class Cylinder:
    def __init__(self, x, m, tilt, debye):
        rough = x * math.cos(math.radians(tilt))
        self.count = int(rough + 14 * rough ** (1 / 3) + 16)
        rough_eta = x * cmath.sqrt(m * m - math.sin(math.radians(tilt)) ** 2)
        mp.dps = DIGITS + 20 + max(lost_digits(self.count, rough), lost_digits(self.count, rough_eta))
        if debye:
            mp.dps += int(2 * rough_eta.imag / math.log(10)) + 20
        self.x = mpf(x)
        self.m2 = (mpc(m) if m.imag else mpf(m.real)) ** 2
        angle = mpf(tilt) * mp.pi / 180
        self.c, self.s = mp.sin(angle), mp.cos(angle)
        self.kappa = mp.sqrt(self.m2 - self.c ** 2)
        self.xi, self.eta = self.x * self.s, self.x * self.kappa
        self.J, self.Y = upward(mp.besselj, self.xi, self.count), upward(mp.bessely, self.xi, self.count)
        self.J_in = upward(mp.besselj, self.eta, self.count)
        self.H1 = [(mpc(a, b), mpc(d, e)) for (a, d), (b, e) in zip(self.J, self.Y)]
        self.H2 = [(mp.conj(a), mp.conj(b)) for a, b in self.H1]
        if debye:
            Y_in = upward(mp.bessely, self.eta, self.count)
            self.H1_in = [(a + 1j * b, d + 1j * e) for (a, d), (b, e) in zip(self.J_in, Y_in)]
            self.H2_in = [(a - 1j * b, d - 1j * e) for (a, d), (b, e) in zip(self.J_in, Y_in)]
        mp.dps = DIGITS + 20

    def columns(self, n, function, inside):
        """(E_z, H_z, E_phi, H_phi) at the surface, over f, of a wave with E_z = f, H_z = 0, and of one with E_z = 0,
        H_z = f (k = 1, wave along z with k_z = -sin(tilt), Z0 H for H)."""
        value, slope = mpf(1), function[1] / function[0]
        kappa = self.kappa if inside else self.s
        m2 = self.m2 if inside else 1
        turn = -n * (-self.c) / self.x * value / kappa ** 2      # (i / kappa^2) (i n k_z / x) f
        return ((value, 0, turn, 1j * m2 * slope / kappa), (0, value, -1j * slope / kappa, turn))

    def solve(self, n, incoming, unknown):
        """The amplitudes (E_z, H_z) of the unknown waves (first: outside, second: inside) for the incoming wave with E_z
        alone and with H_z alone: four columns."""
        (outside, inside), (given, given_inside) = unknown, incoming
        left = self.columns(n, outside, False) + tuple(tuple(-v for v in c) for c in self.columns(n, inside, True))
        A = mp.matrix([[left[j][i] for j in range(4)] for i in range(4)])
        result = []
        for column in self.columns(n, given, given_inside):
            sign = 1 if given_inside else -1
            solution = mp.lu_solve(A, mp.matrix([sign * v for v in column]))
            scales = (given[0] / outside[0], given[0] / inside[0])
            result.append([solution[i] * scales[i // 2] for i in range(4)])
        return result

    def total(self, n):
        I, II = self.solve(n, (self.J[n], False), (self.H1[n], self.J_in[n]))
        b = ((-I[0], -II[0]), (-I[1], -II[1]))                   # ((b_I, b_II), (a_I, a_II))
        self.check_against_book(n, b)
        return b

    def check_against_book(self, n, b):
        c, xi, eta, m2 = self.c, self.xi, self.eta, self.m2
        (J, dJ), (H, dH), (q, dq) = self.J[n], self.H1[n], self.J_in[n]
        D = n * c * eta * q * H * (xi ** 2 / eta ** 2 - 1)
        C = n * c * eta * q * J * (xi ** 2 / eta ** 2 - 1)
        B = xi * (m2 * xi * dq * J - eta * q * dJ)
        V = xi * (m2 * xi * dq * H - eta * q * dH)
        W = 1j * xi * (eta * q * dH - xi * dq * H)
        A = 1j * xi * (xi * dq * J - eta * q * dJ)
        N = W * V + 1j * D ** 2
        book = (((W * B + 1j * D * C) / N, -1j * (C * W + A * D) / N), ((C * V - B * D) / N, -(A * V - 1j * C * D) / N))
        size = max(abs(v) for row in book for v in row)
        for i in range(2):
            for j in range(2):
                assert abs(book[i][j] - b[i][j]) <= mpf(10) ** -30 * size, (n, i, j)

    def debye(self, n, orders):
        """{p: ((b_I, b_II), (a_I, a_II))}; amplitudes of H^(2), H^(1) at the axis are equal."""
        out = self.solve(n, (self.H2[n], False), (self.H1[n], self.H2_in[n]))
        back = self.solve(n, (self.H1_in[n], True), (self.H1[n], self.H2_in[n]))
        matrix = lambda columns, first: mp.matrix([[columns[0][first], columns[1][first]],
                                                   [columns[0][first + 1], columns[1][first + 1]]])
        reflected, entered, left, kept = matrix(out, 0), matrix(out, 2), matrix(back, 0), matrix(back, 2)
        half = mpf(1) / 2
        result = {}
        for p in range(max(orders) + 1):
            if p == 0:
                value = half * (mp.eye(2) - reflected)
            else:
                value = -half * left * entered
                entered = kept * entered
            if p in orders:
                result[p] = ((value[0, 0], value[0, 1]), (value[1, 0], value[1, 1]))
        return result


def amplitudes(coefficients, degrees):
    """T1..T4, sums over n from minus infinity: b_I and a_II are even in n, a_I and b_II odd."""
    step = mp.expjpi(mpf(degrees) / 180)
    turn = mpc(1)
    T1 = T2 = T3 = T4 = mpc(0)
    for n, ((bI, bII), (aI, aII)) in enumerate(coefficients):
        if n == 0:
            T1, T2 = T1 + bI, T2 + aII
        else:
            T1 += 2 * bI * turn.real
            T2 += 2 * aII * turn.real
            T3 += -2j * aI * turn.imag
            T4 += -2j * bII * turn.imag
        turn *= step
    return T1, T2, T3, T4


def number(value):
    return float(mp.nstr(value, 20))


def pair(value):
    return [number(value.real), number(value.imag)]


def lists(coefficients, angles):
    rows = [amplitudes(coefficients, t) for t in angles]
    return {name: [pair(row[i]) for row in rows] for i, name in enumerate(("T1", "T2", "T3", "T4"))}


def case(name, x, m, tilt, orders=()):
    print(name, file=sys.stderr, flush=True)
    m = complex(m)
    cylinder = Cylinder(x, m, tilt, bool(orders))
    total = [cylinder.total(n) for n in range(cylinder.count)]
    ext, sca = [mpf(0), mpf(0)], [mpf(0), mpf(0)]
    for n, (b, a) in enumerate(total):
        weight = 1 if n == 0 else 2
        for k in range(2):
            ext[k] += weight * (b[0] if k == 0 else a[1]).real
            sca[k] += weight * (abs(b[k]) ** 2 + abs(a[k]) ** 2)
    scale = 2 / cylinder.x
    absorbed = [e - s if m.imag else mpf(0) for e, s in zip(ext, sca)]
    by_case = lambda values: {"I": number(scale * values[0]), "II": number(scale * values[1])}
    result = {
        "name": name, "x": x, "m": [m.real, m.imag], "tilt_deg": tilt,
        "Qext": by_case(ext), "Qsca": by_case(sca), "Qabs": by_case(absorbed), "theta_deg": ANGLES,
    }
    result.update(lists(total, ANGLES))
    if orders:
        terms = [cylinder.debye(n, orders) for n in range(cylinder.count)]
        result["orders"] = [dict(p=p, **lists([t[p] for t in terms], ANGLES)) for p in orders]
    return result


def resonance(x, m, tilt, order):
    """The double nearest to the real part of the complex size parameter near x where the order's boundary conditions
    have a solution without incoming light, and twice its imaginary part: the width in x."""
    mp.dps = 60
    angle, m2 = mpf(tilt) * mp.pi / 180, mpc(m) ** 2
    c, s = mp.sin(angle), mp.cos(angle)
    kappa = mp.sqrt(m2 - c ** 2)

    def determinant(value):
        """Bohren & Huffman's W V + i D^2, p. 201, without its zeros of H."""
        xi, eta = value * s, value * kappa
        before, H = (mp.besselj(n, xi) + 1j * mp.bessely(n, xi) for n in (order - 1, order))
        J = mp.besselj(order, eta)
        outer, inner = (before / H - order / xi) * J, (mp.besselj(order - 1, eta) - order / eta * J) * s / kappa
        return (outer - m2 * inner) * (outer - inner) - (order * c * (xi ** 2 / eta ** 2 - 1) / xi * J) ** 2
    pole = mp.findroot(determinant, (mpf(x), mpf(x) + mpf(10) ** -9), solver="secant", tol=mpf(10) ** -100, maxsteps=100,
                       verify=False)
    assert abs(pole - x) < 1e-4, (x, m, tilt, order, pole)
    return float(pole.real), 2 * abs(float(pole.imag))


def on_resonance(name, x, m, tilt, order, beside=0):
    """A case on the peak of a resonance, or so many of its widths beside."""
    peak, width = resonance(x, m, tilt, order)
    print(f"{name}: x = {peak!r}, width {width:.1e}", file=sys.stderr, flush=True)
    return name, peak + beside * width, m, tilt


def main():
    pi = 3.141592653589793
    cases = [
        # Bohren & Huffman's example, appendix C: radius 0.525, wavelength 0.6328.
        ("example of Bohren and Huffman", 2 * pi * 0.525 / 0.6328, 1.55, 0, (0, 1, 2, 3)),
        ("example, tilted", 2 * pi * 0.525 / 0.6328, 1.55, 40, (0, 1, 2, 3, 9)),
        ("smallest", 1e-6, 1.33, 0),
        ("smallest, absorbing, tilted", 1e-6, 1.5 + 0.1j, 45),
        ("small, hardly absorbing", 1e-3, 1.33 + 1e-9j, 10),
        ("small, dense", 0.1, 10 + 10j, 60),
        ("small metal", 0.5, 0.2 + 3j, 20),
        ("small, grazing", 1.0, 1.5, 85),
        ("index near 1, small", 1.0, 1.0001, 30),
        ("pi", pi, 1.33, 0),
        ("beside a narrow resonance", 48.20995, 1.5, 0),
        on_resonance("on a narrow resonance", 48.2099496784, 1.5, 0, 66),
        ("bubble", 100.0, 0.75, 0, (0, 1, 2)),
        ("bubble, evanescent inside", 100.0, 0.75, 60, (0, 1, 2)),
        ("thin evanescent bubble", 2.0, 0.75, 70, (0, 1, 2)),
        ("next to the critical tilt", 100.0, 0.5, 30.000001),
        ("below the critical tilt", 100.0, 0.5, 29.99, (0, 1)),
        ("absorbing", 100.0, 1.5 + 0.05j, 70, (0, 1, 2, 3)),
        ("opaque", 300.0, 1.5 + 0.5j, 30, (0, 1)),
        ("hair", 500.0, 1.55 + 1e-4j, 0, (0, 1, 2, 3)),
        ("hair, tilted", 500.0, 1.55 + 1e-4j, 50, (0, 1, 2, 3)),
        ("hair, grazing", 500.0, 1.55 + 1e-4j, 85, (0, 1, 2)),
        ("hair, nearly along", 500.0, 1.55, 89.5),
        ("largest", 5000.0, 1.55, 0, (0, 1, 2, 3, 6)),
        ("largest, tilted", 5000.0, 1.55, 30, (0, 1, 2)),
        ("largest, grazing", 5000.0, 1.55, 85, (0, 1, 2)),
        ("largest, hardly absorbing", 5000.0, 1.33 + 1e-9j, 10),
        ("largest, dense", 5000.0, 10 + 10j, 40),
        ("largest, index near 1", 5000.0, 1.0001, 0),
        ("largest, index near 1, tilted", 5000.0, 1.0001, 60),
        ("largest bubble, evanescent inside", 5000.0, 0.75, 60),
        ("thousand pi", 1000 * pi, 1.333, 20),
    ]
    cases += [on_resonance(*near) for near in RESONANCES]
    if len(sys.argv) > 1:
        cases = [c for c in cases if c[0] in sys.argv[1:]]
    # The big ones are independent: a pool only saves time.
    from multiprocessing import Pool
    with Pool() as pool:
        results = pool.starmap(case, cases, chunksize=1)
    print("[")
    print(",\n".join(json.dumps(r) for r in results))
    print("]")


# Name, a size near the peak, index, tilt, order n; whole widths beside the peak. At a tilt each n has resonances of either
# kind, here named after the one that it turns into at normal incidence.
RESONANCES = [
    ("resonance, x 51, E along the axis", 50.9751122, 1.5, 0, 70),                        # width 7e-10
    ("resonance, x 51, H along the axis", 51.4569881, 1.5, 0, 70),                        # 1e-9
    ("resonance, x 51, absorbing as much", 50.9751122, 1.5 + 1e-11j, 0, 70),              # 1e-9, half of it k's
    ("resonance, x 50, tilted", 49.8754263, 1.5, 35, 63),                                 # 3e-13
    ("resonance, x 50, tilted, the other", 49.8976203, 1.5, 35, 62),                      # 4e-13
    ("resonance, x 199, E along the axis", 199.2603782, 1.33, 0, 221),                    # 2e-6
    ("resonance, x 200, H along the axis", 200.3085498, 1.33, 0, 233),                    # 3e-11
    ("half a width beside, x 200", 200.3085498, 1.33, 0, 233, 0.5),
    ("resonance, x 200, tilted", 200.1298445, 1.55, 30, 206),                             # 2e-12
    ("resonance, x 200, tilted, absorbing", 200.1298445, 1.55 + 1e-14j, 30, 206),         # 5e-12
    ("resonance, x 200, tilted, wide", 199.6393297, 1.55, 30, 194),                       # 6e-7
    ("two widths beside, x 200, tilted", 200.1298445, 1.55, 30, 206, 2),
    ("resonance, x 500, tilted", 500.2206942, 1.55, 60, 285),                             # 6e-12
    ("resonance, x 499, tilted, absorbing", 498.7533995, 1.55 + 1e-13j, 60, 285),         # 1e-10
    ("resonance, x 499, grazing", 498.7074404, 1.33, 85, 61),                             # 6e-11
    ("resonance, x 499, grazing, wide", 499.3168454, 1.33, 85, 57),                       # 5e-8
    ("resonance, x 996, E along the axis", 996.2231479, 1.5, 0, 1052),                    # 9e-12
    ("resonance, x 996, H along the axis", 996.5137838, 1.5, 0, 1052),                    # 2e-11
    ("resonance, x 996, E along the axis, wide", 996.139367, 1.5, 0, 1044),               # 1e-9
    ("resonance, x 1000, tilted", 1000.3218857, 1.5, 20, 995),                            # 1e-11
    ("resonance, x 1000, tilted, narrow", 1000.4098386, 1.333, 45, 762),                  # 6e-13
]

if __name__ == "__main__":
    main()
