#!/usr/bin/env python3
"""Makes ellipse_truth.json: rays in a dielectric cylinder of elliptical section, independently of the library.

Usage: make_ellipse_truth.py > ellipse_truth.json  (needs mpmath; gmpy2 makes it fast: about five minutes of two cores)

Nothing here is shared with the library's method. Rays are traced in three dimensions with 50 digits: vectors are
refracted by Snell's law (no Bravais index), split by Fresnel's coefficients at the angles in space, and turn by a
continuous angle at every surface. The offset h = sin(gamma) across the light is sampled ever finer until neighbours
and what is between them agree in every order's cosine of exit, azimuth and direction inside; critical offsets, where
an order begins or ceases to be reflected totally, are bisected between samples and at extrema between them. Caustics
are zeros of the azimuth's numerical derivative. Energies and moments are integrals over h by tanh-sinh rules, halved
until they agree to 1e-22, on pieces between all critical offsets of all orders and the roots of the azimuths 0,
+-pi/2 and pi; N_p(phi) is the sum of A_p / |2 d phi/d h| over the roots of phi_p(h) = phi + 2 pi m between caustics
and critical offsets. `condition` is the sum over the inputs (eta, axis ratio, theta_d, phi_i, phi) of |d ln N/d x|
times |x|, for angles times pi: what one relative rounding in each may do to N. Inputs are the exact values of their
doubles. Source of the formulas: Marschner et al. (2003) for N_p; the trace itself is Snell's law, Fresnel's formulas
and the equation of an ellipse.
"""
import json
import sys
from concurrent.futures import ProcessPoolExecutor

from mpmath import mp, mpf

mp.dps = 50
FINEST = mpf(10) ** -30


class Ellipse:
    def __init__(self, eta, sigma_a, axis_ratio, theta_d, phi_i):
        self.eta, self.sigma_a, self.phi_i = mpf(eta), mpf(sigma_a), mpf(phi_i)
        self.b = mp.sqrt(mpf(axis_ratio))
        self.a = 1 / self.b
        self.cos_d, self.sin_d = mp.cos(theta_d), mp.sin(theta_d)
        self.toward = (mp.cos(phi_i), mp.sin(phi_i))
        self.across = (-self.toward[1], self.toward[0])
        self.width = mp.sqrt((self.a * self.toward[1]) ** 2 + (self.b * self.toward[0]) ** 2)

    def normal(self, x, y):
        nx, ny = x / self.a ** 2, y / self.b ** 2
        n = mp.sqrt(nx * nx + ny * ny)
        return nx / n, ny / n

    @staticmethod
    def mean_fresnel(n1, n2, c1, c2):
        r_s = (n1 * c1 - n2 * c2) / (n1 * c1 + n2 * c2)
        r_p = (n2 * c1 - n1 * c2) / (n2 * c1 + n1 * c2)
        return (r_s * r_s + r_p * r_p) / 2

    @staticmethod
    def slant(nx, ny, d):
        return mp.atan2(nx * d[1] - ny * d[0], nx * d[0] + ny * d[1])

    def trace(self, gamma, last):
        """For orders 0..last: (squared cosine of exit in space, azimuth not wrapped (0: back to the light), A_p,
        azimuth of the ray before)."""
        h, c = mp.sin(gamma), mp.cos(gamma)
        L, e, w = self.toward, self.across, self.width * h
        aa, bb = self.a ** 2, self.b ** 2
        A = L[0] ** 2 / aa + L[1] ** 2 / bb
        B = w * (e[0] * L[0] / aa + e[1] * L[1] / bb)
        s = (-B + mp.sqrt(A) * abs(c)) / A  # the quadratic's discriminant is A cos^2 gamma
        x, y = w * e[0] + s * L[0], w * e[1] + s * L[1]
        nx, ny = self.normal(x, y)
        d = (-self.cos_d * L[0], -self.cos_d * L[1], self.sin_d)
        c1 = -(d[0] * nx + d[1] * ny)
        c2 = mp.sqrt(1 - (1 - c1 * c1) / self.eta ** 2)
        F = self.mean_fresnel(mpf(1), self.eta, c1, c2)
        beta = self.slant(-nx, -ny, d)
        orders = [(mpf(1), 2 * mp.pi - 2 * beta, F, beta)]
        k = c1 / self.eta - c2
        d = (d[0] / self.eta + k * nx, d[1] / self.eta + k * ny, d[2] / self.eta)
        psi = mp.pi + self.slant(-nx, -ny, d) - beta
        light = 1 - F
        for _ in range(last):
            length = -2 * (x * d[0] / aa + y * d[1] / bb) / (d[0] ** 2 / aa + d[1] ** 2 / bb)
            x, y = x + length * d[0], y + length * d[1]
            if self.sigma_a:
                light *= mp.exp(-self.sigma_a * length)
            nx, ny = self.normal(x, y)
            c1 = d[0] * nx + d[1] * ny
            square = 1 - self.eta ** 2 * (1 - c1 * c1)
            alpha = self.slant(nx, ny, d)
            if square >= 0:
                c2 = mp.sqrt(square)
                F = self.mean_fresnel(self.eta, mpf(1), c1, c2)
                k = c2 - self.eta * c1
                out = (self.eta * d[0] + k * nx, self.eta * d[1] + k * ny)
                orders.append((square, psi + self.slant(nx, ny, out) - alpha, light * (1 - F), psi))
                light *= F
            else:
                orders.append((square, None, mpf(0), psi))
            psi += mp.pi - 2 * alpha
            d = (d[0] - 2 * c1 * nx, d[1] - 2 * c1 * ny, d[2])
        return orders


def bisect(f, a, b):
    """A root between a and b, where f changes its sign: halving, then the Illinois variant of false position."""
    fa, fb = f(a), f(b)
    for step in range(600):
        m = (a + b) / 2 if step < 6 or step % 12 == 0 else (a * fb - b * fa) / (fb - fa)
        fm = f(m)
        if fm == 0 or abs(b - a) < mpf(10) ** -45 or m in (a, b):
            return m
        if (fm > 0) == (fb > 0):
            fa /= 2
        else:
            a, fa = b, fb
        b, fb = m, fm
    raise ArithmeticError("no convergence")


def extremum(f, a, m, b):
    """Where f is largest, f(m) >= f(a), f(b): golden sections; only its sign there matters."""
    for _ in range(60):
        left, right = (a + m) / 2, (m + b) / 2
        best = max((f(left), 0), (f(m), 1), (f(right), 2))[1]
        a, m, b = ((a, left, m), (left, m, right), (m, right, b))[best]
    return m


class Map:
    """Critical offsets and caustics of all orders up to `last`."""

    def __init__(self, ellipse, last):
        self.ellipse, self.last = ellipse, last
        self.memory = {}
        count = 240
        rim = mp.pi / 2
        gammas = [rim * (mpf(2 * i) / count - 1) for i in range(count + 1)]
        gammas += [s * (rim - rim * mpf(2) ** -k) for k in range(6, 50) for s in (1, -1)]
        gammas.sort()
        self.grid = [gammas[0]]
        for a, b in zip(gammas, gammas[1:]):
            self.refine(a, b)
        self.cuts = [self.cuts_of(p) for p in range(last + 1)]
        self.pieces = [self.pieces_of(p) for p in range(last + 1)]

    def at(self, gamma):
        found = self.memory.get(gamma)
        if found is None:
            found = self.memory[gamma] = self.ellipse.trace(gamma, self.last)
        return found

    def refine(self, a, b):
        m = (a + b) / 2
        fine = b - a < FINEST or all(
            abs(one[0] - other[0]) < 0.1 and abs(one[3] - other[3]) < 0.1
            and (one[1] is None or other[1] is None or abs(one[1] - other[1]) < 0.4)
            for end in (a, b) for one, other in zip(self.at(end), self.at(m)))
        if not fine:
            self.refine(a, m)
            self.refine(m, b)
        else:
            self.grid += [m, b]

    def cuts_of(self, p):
        if p == 0:
            return []
        f = lambda g: self.ellipse.trace(g, p)[p][0]
        grid = [(g, self.at(g)[p][0]) for g in self.grid]
        points = list(grid)
        for (a, fa), (m, fm), (b, fb) in zip(grid, grid[1:], grid[2:]):
            if fa > 0 and fb > 0 and 0 < fm <= min(fa, fb):
                top = extremum(lambda g: -f(g), a, m, b)
            elif fa < 0 and fb < 0 and 0 > fm >= max(fa, fb):
                top = extremum(f, a, m, b)
            else:
                continue
            points.append((top, f(top)))
        points.sort()
        return [bisect(f, a, b) for (a, fa), (b, fb) in zip(points, points[1:]) if (fa > 0) != (fb > 0)]

    def azimuth(self, g, p):
        return self.ellipse.trace(g, p)[p][1]

    def slope(self, g, p, a, b):
        step = min(g - a, b - g) * mpf(10) ** -16
        return (self.azimuth(g + step, p) - self.azimuth(g - step, p)) / (2 * step)

    def pieces_of(self, p):
        """Stretches (a, b, ends of the pieces between critical offsets) over which the azimuth turns one way."""
        edges = [-mp.pi / 2] + self.cuts[p] + [mp.pi / 2]
        found = []
        for a, b in zip(edges, edges[1:]):
            if b - a < FINEST or self.ellipse.trace((a + b) / 2, p)[p][0] < 0:
                continue
            if p == 0:
                found.append((a, b, a, b))
                continue
            inner = [g for g in self.grid if a < g < b]
            inner += [a + (b - a) * mpf(2) ** -k for k in range(1, 40)]
            inner += [b - (b - a) * mpf(2) ** -k for k in range(2, 40)]
            inner = sorted(set(inner))
            # The cosine of exit keeps the slope finite at critical offsets.
            f = lambda g: self.slope(g, p, a, b) * mp.sqrt(abs(self.ellipse.trace(g, p)[p][0]))
            points = [(g, f(g)) for g in inner]
            extra = []
            for (l, fl), (m, fm), (r, fr) in zip(points, points[1:], points[2:]):
                if (fl > 0) == (fm > 0) == (fr > 0) and abs(fm) <= min(abs(fl), abs(fr)):
                    sign = 1 if fm > 0 else -1
                    top = extremum(lambda g: -sign * f(g), l, m, r)
                    extra.append((top, f(top)))
            points = sorted(points + extra)
            turns = [bisect(f, l, r) for (l, fl), (r, fr) in zip(points, points[1:]) if (fl > 0) != (fr > 0)]
            marks = [a] + turns + [b]
            found += [(l, r, a, b) for l, r in zip(marks, marks[1:])]
        return found

    def end(self, g, p):
        """The azimuth at the end of a piece, where rounding may find total reflection."""
        phi = self.azimuth(g, p)
        if phi is None:
            for shift in (mpf(10) ** -44, -mpf(10) ** -44):
                phi = self.azimuth(g + shift, p)
                if phi is not None:
                    break
        return phi

    def roots(self, p, phi):
        found = []
        for a, b, low, high in self.pieces[p]:
            fa, fb = self.end(a, p), self.end(b, p)
            turn = 2 * mp.pi
            for m in range(int(mp.ceil((min(fa, fb) - phi) / turn)), int(mp.floor((max(fa, fb) - phi) / turn)) + 1):
                target = phi + m * turn
                inside = mpf(10) ** -40 * (b - a)
                f = lambda g: self.azimuth(g, p) - target
                if (f(a + inside) > 0) != (f(b - inside) > 0):
                    found.append((bisect(f, a + inside, b - inside), low, high))
        return found

    def caustics(self, p):
        """Wrapped, at the ends of pieces that are no critical offsets."""
        tops = [a for a, b, low, high in self.pieces[p] if a != low]
        phis = [self.azimuth(g, p) for g in tops]
        return sorted(phi - 2 * mp.pi * mp.nint(phi / (2 * mp.pi)) for phi in phis)


def term(ellipse, g, p, step):
    """What a ray adds to N; its azimuth, and the derivative of it."""
    after, before = ellipse.trace(g + step, p)[p][1], ellipse.trace(g - step, p)[p][1]
    _, phi, energy, _ = ellipse.trace(g, p)[p]
    slope = (after - before) / (2 * step)
    return energy * mp.cos(g) / abs(2 * slope), phi, slope


def distribution(mapped, inputs, p, phi):
    """N_p(phi) and its condition."""
    ellipse = mapped.ellipse
    eta, sigma_a, axis_ratio, theta_d, phi_i = inputs
    total, changes = mpf(0), [mpf(0)] * 5
    sizes = [mpf(eta), mpf(axis_ratio), mp.pi, mp.pi]
    for g, low, high in mapped.roots(p, phi):
        room = min(g - low, high - g)
        total += term(ellipse, g, p, room * mpf(10) ** -15)[0]
        # For the condition a few digits do: steps small beside the room, large beside rounding.
        step, delta = room * mpf(10) ** -7, room * mpf(10) ** -12
        value, at, slope = term(ellipse, g, p, step)
        along = (term(ellipse, g + delta, p, step)[0] - value) / delta
        changes[4] += along / slope * mp.pi
        for k, size in enumerate(sizes):
            moved = [mpf(eta), mpf(axis_ratio), mpf(theta_d), mpf(phi_i)]
            moved[k] += delta
            other = Ellipse(moved[0], sigma_a, moved[1], moved[2], moved[3])
            shifted, phi_there, _ = term(other, g, p, step)
            changes[k] += (shifted - value - along * (phi_there - at) / slope) / delta * size
    return total, sum(abs(c) for c in changes) / total if total else mpf(0)


STEP = mpf(1) / 9
RULE = [(mp.tanh(x), STEP * mp.pi / 2 * mp.cosh(t) / mp.cosh(x) ** 2)
        for t in (k * STEP for k in range(-30, 31)) for x in (mp.pi / 2 * mp.sinh(t),)]


def moments(mapped):
    """Energy, that weighed with |phi|/pi and that of |phi| >= pi/2, of every order: one quadrature for all."""
    last, ellipse = mapped.last, mapped.ellipse
    cuts = {-mp.pi / 2, mp.pi / 2}
    for p in range(last + 1):
        cuts.update(mapped.cuts[p])
        for kink in (mpf(0), mp.pi / 2, -mp.pi / 2, mp.pi):
            cuts.update(root[0] for root in mapped.roots(p, kink))
    cuts = sorted(cuts)
    total = [[mpf(0)] * 3 for _ in range(last + 1)]

    def panel(a, b):
        middle, half = (a + b) / 2, (b - a) / 2
        forward = []
        for _, phi, _, _ in ellipse.trace(middle, last):
            phi = phi if phi is not None else mpf(0)
            forward.append(abs(phi - 2 * mp.pi * mp.nint(phi / (2 * mp.pi))) > mp.pi / 2)
        sums = [[mpf(0)] * 3 for _ in range(last + 1)]
        for x, weight in RULE:
            g = middle + half * x
            dh = mp.cos(g) / 2 * half * weight
            for p, (_, phi, energy, _) in enumerate(ellipse.trace(g, last)):
                if energy:
                    phi -= 2 * mp.pi * mp.nint(phi / (2 * mp.pi))
                    sums[p][0] += energy * dh
                    sums[p][1] += energy * dh * abs(phi) / mp.pi
                    sums[p][2] += energy * dh if forward[p] else 0
        return sums

    def adapt(a, b, whole, depth):
        m = (a + b) / 2
        left, right = panel(a, m), panel(m, b)
        error = max(abs(l + r - w) for x, y, z in zip(left, right, whole) for l, r, w in zip(x, y, z))
        if error < mpf(10) ** -22 or b - a < mpf(10) ** -28:
            for row, x, y in zip(total, left, right):
                for k in range(3):
                    row[k] += x[k] + y[k]
            return
        if depth == 0:
            raise ArithmeticError("the quadrature does not converge")
        adapt(a, m, left, depth - 1)
        adapt(m, b, right, depth - 1)

    for a, b in zip(cuts, cuts[1:]):
        if b - a > FINEST:
            adapt(a, b, panel(a, b), 60)
    return total


def make(case):
    inputs, orders = case
    mapped = Map(Ellipse(*inputs), max(orders))
    sums = moments(mapped)
    rows = []
    for p in orders:
        caustics = mapped.caustics(p)
        phis = [0.05, 0.37, 1.1, 2.0, 2.9, -0.6, -1.7, -2.5, -3.1]
        for c in caustics[::max(1, len(caustics) // 3)]:
            phis += [float(c) + s * e for s in (1, -1) for e in (1e-2, 1e-4, 1e-6) if abs(float(c) + s * e) < 3.14]
        values = [distribution(mapped, inputs, p, mpf(phi)) for phi in phis]
        rows.append({
            "eta": inputs[0], "sigma_a": inputs[1], "axis_ratio": inputs[2], "theta_d": inputs[3], "phi_i": inputs[4],
            "order": p, "critical": len(mapped.cuts[p]), "caustics": [float(c) for c in caustics],
            "moments": [float(m) for m in sums[p]],
            "phi": phis, "N": [float(n) for n, _ in values], "condition": [float(mp.nstr(c, 3)) for _, c in values],
        })
        print(inputs, p, len(mapped.cuts[p]), rows[-1]["caustics"], rows[-1]["moments"], file=sys.stderr, flush=True)
    return rows


CASES = [  # (eta, sigma_a, axis ratio, theta_d, phi_i), orders
    ((1.55, 0.1, 0.95, 0.2, 0.6), [0, 1, 2, 3, 5]),
    ((1.55, 0.0, 0.7, 0.3, 0.4), [0, 1, 2, 3, 5]),
    ((1.55, 0.2, 0.4, -0.5, 1.5), [0, 1, 2, 3, 5]),
    ((1.55, 0.3, 0.85, 0.0, 0.0), [0, 1, 2, 3, 5]),
    ((1.345, 0.05, 0.6, 0.1, 2.5), [0, 1, 2, 3, 5]),
    ((1.55, 0.05, 0.3, 0.9, -1.1), [0, 1, 2, 3, 5]),
    ((2.4, 0.0, 0.8, 0.4, -2.0), [0, 1, 2, 3, 5]),
    ((1.55, 0.1, 0.75, 1.4, 0.9), [0, 1, 2, 3, 5]),
]


def main():
    cases = CASES if len(sys.argv) < 2 else [CASES[int(i)] for i in sys.argv[1:]]
    with ProcessPoolExecutor(2) as pool:
        rows = [row for part in pool.map(make, cases) for row in part]
    json.dump({"made_by": "make_ellipse_truth.py", "cases": rows}, sys.stdout, indent=1)


if __name__ == "__main__":
    main()
