#!/usr/bin/env python3
"""Figures behind the errata of sadeghi-dissertation.md, from the tables in this repository and elementary ray optics.

Independent of the library: Python's standard library only. Run from anywhere: python3 papers/check_dissertation.py
"""

import math
from pathlib import Path

TABLES = Path(__file__).resolve().parent.parent / "tables"
WATER = 1.333


def table(name):
    lines = [line.split("#")[0].strip() for line in (TABLES / name).read_text().splitlines()]
    return [[float(v) for v in line.split(",")] for line in [line for line in lines if line][1:]]


def interpolated(rows, key):
    for low, high in zip(rows, rows[1:]):
        if low[0] <= key <= high[0]:
            f = (key - low[0]) / (high[0] - low[0])
            return [a + f * (b - a) for a, b in zip(low[1:], high[1:])]
    raise ValueError(f"{key} is outside the table")


BEARD_CHUANG = table("drops/beard_chuang_1987.csv")
CHUANG_BEARD = table("drops/chuang_beard_1990.csv")


def table_3_1(radius_mm):
    return interpolated(BEARD_CHUANG, radius_mm)


def chuang_beard(radius_mm):
    """Below the first row the deformation fades with the square of the diameter, as the library has it."""
    diameter = 2 * radius_mm
    fade = min(diameter / CHUANG_BEARD[0][0], 1) ** 2
    return [1e-4 * fade * c for c in interpolated(CHUANG_BEARD, max(diameter, CHUANG_BEARD[0][0]))]


# Section A: tables.


def volume_and_axis_ratio(c, samples=4000):
    volume = top = bottom = width = 0.0
    for i in range(samples):
        theta = math.pi * (i + 0.5) / samples
        r = 1 + sum(a * math.cos(n * theta) for n, a in enumerate(c))
        volume += r**3 * math.sin(theta) * math.pi / samples / 2
        bottom, top = max(bottom, r * math.cos(theta)), max(top, -r * math.cos(theta))
        width = max(width, r * math.sin(theta))
    return volume, (top + bottom) / 2 / width


def deflection(n, p, b):
    """Sphere: deflection [rad] counted positive towards the axis, and optical path between planes through the centre."""
    i = math.asin(b)
    r = math.asin(b / n)
    return 2 * (i - r) + (p - 1) * (math.pi - 2 * r), 2 * (p * n * math.cos(r) - math.cos(i))


def bow_impact(n, p):
    return math.sqrt((p * p - n * n) / (p * p - 1))


def folded_deg(angle):
    return abs(math.remainder(math.degrees(angle), 360))


def iapws(wavelength_nm, temperature=298.15, density=997.047):
    t, d, s = temperature / 273.15, density / 1000, (wavelength_nm / 589) ** 2
    a = (0.244257733 + 9.74634476e-3 * d - 3.73234996e-3 * t + 2.68678472e-4 * s * t + 1.58920570e-3 / s
         + 2.45934259e-3 / (s - 0.2292020**2) + 0.900704920 / (s - 5.432937**2) - 1.66626219e-2 * d * d) * d
    return math.sqrt((1 + 2 * a) / (1 - a))


# Section B: focal lines. Two rays of order p meet at one angle on either side of the bow's impact parameter.


def two_rays(n, p, angle):
    """Optical path of the outer ray minus that of the inner one."""
    bow = bow_impact(n, p)
    paths = []
    for low, high in ((0.3, bow), (1 - 1e-12, bow)):
        for _ in range(100):
            b = (low + high) / 2
            low, high = (b, high) if deflection(n, p, b)[0] > angle else (low, b)
        paths.append(deflection(n, p, low)[1])
    return paths[1] - paths[0]


def maxima(n, p, x, focal_phase, count):
    """Angles where the two rays' phases x * path + focal_phase agree modulo a whole turn."""
    found = []
    start = deflection(n, p, bow_impact(n, p))[0]
    turn, angle = 0, start + 1e-6
    while len(found) < count:
        low, high = angle, start + math.radians(12)
        target = 2 * math.pi * turn
        turn += 1
        if x * two_rays(n, p, low) + focal_phase >= target:
            continue
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if x * two_rays(n, p, middle) + focal_phase < target else (low, middle)
        found.append(folded_deg(low))
    return found


# Section C: rays in the vertical plane of the sun, through the drop of any polar curve.


class Drop:
    def __init__(self, c):
        self.c = [1 + c[0], *c[1:]]

    def misfit(self, x, z):
        return math.hypot(x, z) - sum(a * math.cos(n * math.atan2(x, -z)) for n, a in enumerate(self.c))

    def normal(self, x, z):
        theta, r = math.atan2(x, -z), math.hypot(x, z)
        slope = -sum(n * a * math.sin(n * theta) for n, a in enumerate(self.c)) / r
        nx, nz = x / r - slope * math.cos(theta), z / r - slope * math.sin(theta)
        return nx / math.hypot(nx, nz), nz / math.hypot(nx, nz)

    def meet(self, x, z, dx, dz, low, high):
        sign = self.misfit(x + low * dx, z + low * dz) > 0
        for _ in range(60):
            t = (low + high) / 2
            low, high = (t, high) if (self.misfit(x + t * dx, z + t * dz) > 0) == sign else (low, t)
        return (low + high) / 2

    def ray(self, sun, b, p):
        """b > 0: enters on the lower side. Deflection towards the axis [rad] and, for the last column of section C,
        cos r cos i' / (cos i cos r'): i, r where the ray enters, r', i' where it leaves."""
        side = 1 if b > 0 else -1
        dx, dz, ex, ez = math.cos(sun), -math.sin(sun), -math.sin(sun), -math.cos(sun)
        x, z = b * ex, b * ez
        inside = min((self.misfit(x + 0.01 * k * dx, z + 0.01 * k * dz), 0.01 * k) for k in range(-60, 61))[1]
        t = self.meet(x, z, dx, dz, -3, inside)
        x, z = x + t * dx, z + t * dz
        nx, nz = self.normal(x, z)
        cos_i = -(dx * nx + dz * nz)
        cos_r = math.sqrt(1 - (1 - cos_i**2) / WATER**2)
        bend = cos_i / WATER - cos_r
        dx, dz = dx / WATER + bend * nx, dz / WATER + bend * nz
        for bounce in range(p):
            t = self.meet(x, z, dx, dz, 1e-3, 3)
            x, z = x + t * dx, z + t * dz
            nx, nz = self.normal(x, z)
            c = dx * nx + dz * nz
            if bounce < p - 1:
                dx, dz = dx - 2 * c * nx, dz - 2 * c * nz
        out = math.sqrt(1 - WATER**2 * (1 - c * c))
        bend = out - WATER * c
        dx, dz = WATER * dx + bend * nx, WATER * dz + bend * nz
        along = dx * math.cos(sun) - dz * math.sin(sun)
        return math.atan2(-side * (dx * ex + dz * ez), along) % (2 * math.pi), cos_r * out / (cos_i * c)

    def bow(self, sun_deg, p):
        """Top of the bow [deg], from rays that enter on the upper side, and the ratio of ray()."""
        sun, b0 = math.radians(sun_deg), bow_impact(WATER, p)
        low, high = b0 - 0.15, min(b0 + 0.08, 0.975)
        for _ in range(40):
            left, right = high - 0.618034 * (high - low), low + 0.618034 * (high - low)
            low, high = (low, right) if self.ray(sun, -left, p)[0] < self.ray(sun, -right, p)[0] else (left, high)
        angle, ratio = self.ray(sun, -low, p)
        return math.degrees(angle), ratio


def main():
    print("A. Table 3.1: volume - 1 and axis ratio of the rows and halfway between them")
    for low, high in zip(BEARD_CHUANG, BEARD_CHUANG[1:]):
        for radius in ((low[0] + high[0]) / 2, high[0]):
            volume, ratio = volume_and_axis_ratio(table_3_1(radius))
            print(f"   {radius:4.2f} mm  {volume - 1:+.1e}  {ratio:.4f}")
    print("   Axis ratio: table 3.1, Chuang & Beard 1990, the fit of Beard & Chuang 1987 in the diameter")
    for radius in (0.4, 0.45, 0.5, 0.7):
        d = 2 * radius
        fit = 1.0048 + 5.7e-4 * d - 2.628e-2 * d**2 + 3.682e-3 * d**3 - 1.677e-4 * d**4
        print(f"   {radius:4.2f} mm  {volume_and_axis_ratio(table_3_1(radius))[1]:.4f}"
              f"  {volume_and_axis_ratio(chuang_beard(radius))[1]:.4f}  {fit:.4f}")

    print("   Table 3.2 and section 3.2.1: index, primary, secondary [deg]")
    hale_querry = dict((int(w), n) for w, n in table("water/hale_querry.csv"))
    for name, red, violet in (("section 3.2.1", 1.3314, 1.3445), ("table 3.2", hale_querry[700], hale_querry[400]),
                              ("IAPWS at 25 C", iapws(700), iapws(400))):
        for wavelength, n in ((700, red), (400, violet)):
            bows = [folded_deg(deflection(n, p, bow_impact(n, p))[0]) for p in (2, 3)]
            print(f"   {name:14s} {wavelength} nm  {n:.4f}  {bows[0]:.2f}  {bows[1]:.2f}")

    print("   Table 3.3 against radius^(-2/3) through its first row [deg]")
    widths = table("diffraction/gaussian_width.csv")
    print("  ", "  ".join(f"{a:.1f}: {s:.2f}/{widths[0][1] * (a / widths[0][0]) ** (-2 / 3):.3f}" for a, s in widths))
    print(f"   Airy's width, secondary over primary: {(27.910 / 4.8992) ** (1 / 3):.3f}")

    x = 1000.0
    print(f"B. Sphere, x = {x:.0f}, n = {WATER}: maxima of two interfering rays [deg], by the outer ray's extra phase")
    for p in (2, 3):
        for name, phase in (("-pi/2", -math.pi / 2), ("0", 0.0), ("+pi/2", math.pi / 2)):
            print(f"   p = {p}  {name:6s}", "  ".join(f"{a:.2f}" for a in maxima(WATER, p, x, phase, 4)))

    print("C. Top of the primary bow [deg]: radius, sun, table 3.1, Chuang & Beard 1990")
    for radius in (0.4, 0.45, 0.5):
        for sun in (0, 20, 40):
            print(f"   {radius:4.2f} mm  {sun:2d} deg  {Drop(table_3_1(radius)).bow(sun, 2)[0]:.3f}"
                  f"  {Drop(chuang_beard(radius)).bow(sun, 2)[0]:.3f}")
    print("   Energy of the bow's ray, energy-normalised over bare Fresnel coefficients, table 3.1")
    for radius in (0.4, 0.5, 1.0):
        print("  ", f"{radius:4.2f} mm ", "  ".join(f"sun {h} deg: {Drop(table_3_1(radius)).bow(h, 2)[1]:.3f}" for h in (0, 20)))


if __name__ == "__main__":
    main()
