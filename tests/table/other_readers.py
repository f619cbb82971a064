"""Reads the tables of write_example_tables with the programs that people have: other_readers.py WHAT FOLDER [PROGRAM]."""

import json
import subprocess
import sys

import numpy


def header_of(program, *arguments):
    return subprocess.run([program, *arguments], check=True, capture_output=True, encoding="utf-8").stdout


def require(text, *parts):
    for part in parts:
        assert part in text, f"{part!r} is not in:\n{text}"


def ncdump(folder, program):
    require(
        header_of(program, "-h", f"{folder}/plain.nc"),
        "wavelength = 3 ;",
        "theta = 181 ;",
        "phi = 36 ;",
        "order = 4 ;",
        "double phase_function(wavelength, theta, phi) ;",
        'phase_function:units = "sr-1" ;',
        'wavelength:units = "m" ;',
        'theta:units = "degree" ;',
        "double order_energy(wavelength, order) ;",
        "double error_estimate(wavelength, theta) ;",
        "double scattering_cross_section(wavelength) ;",
        ':Conventions = "CF-1.10" ;',
        ":seconds = 12.3456789012346 ;",
        ':device = "a device, with \u00b5" ;',
        ':constant_shape = "beard-chuang" ;',
    )
    require(
        header_of(program, "-hs", f"{folder}/everything.nc"),
        "float phase_matrix(wavelength, theta, phi, row, col) ;",
        "float amplitude_re(wavelength, order, theta, phi, amplitude_row, amplitude_col) ;",
        "float amplitude_sum_im(wavelength, theta, phi, amplitude_row, amplitude_col) ;",
        "phase_function:_ChunkSizes = 1, 181, 36 ;",
        'phase_function:_Shuffle = "true" ;',
        "phase_function:_DeflateLevel = 1 ;",
    )


def xarray(folder):
    import xarray

    with xarray.open_dataset(f"{folder}/plain.nc") as table:
        assert table.phase_function.dims == ("wavelength", "theta", "phi")
        assert table.phase_function.shape == (3, 181, 36)
        assert table.phase_function.dtype == numpy.float64
        assert table.attrs["Conventions"] == "CF-1.10"
        assert abs(table.wavelength.values[0] - 380e-9) < 1e-20
        # By coordinates, as people do it.
        assert float(table.phase_function.sel(theta=138, phi=10, method="nearest")[1]) > 0
        # Henyey-Greenstein with fringes that average out over phi: the integral is 1.
        ring = table.phase_function.mean("phi") * numpy.sin(numpy.radians(table.theta))
        integral = 2 * numpy.pi * ring.integrate("theta") * numpy.pi / 180
        assert numpy.allclose(integral, 1, atol=2e-3), integral.values
    with xarray.open_dataset(f"{folder}/everything.nc") as table, open(f"{folder}/everything.json") as file:
        other = json.load(file)
        assert table.phase_matrix.shape == (3, 181, 36, 4, 4)
        assert numpy.allclose(table.phase_matrix, other["phase_matrix"], rtol=1e-7, atol=1e-9)
        first = table.amplitude_sum_re[2, 100, 7] + 1j * table.amplitude_sum_im[2, 100, 7]
        named = {name: complex(*value) for name, value in other["amplitude"][2][100][7].items()}
        expected = [[named["S2"], named["S3"]], [named["S4"], named["S1"]]]
        assert numpy.allclose(first, expected, rtol=1e-6)
        second = table.amplitude_re.sel(order=5)[0, 3, 4, 1, 1]
        assert numpy.isclose(second, other["orders"][3]["amplitude"][0][3][4]["S1"][0], rtol=1e-6)
        assert numpy.array_equal(table.order_energy, other["order_energy"])


def exrheader(folder, program):
    require(
        header_of(program, f"{folder}/plain.exr"),
        "part 2",
        'name (type string): "380,000000nm"',
        "S0.380,000000nm, 32-bit floating-point",
        "dataWindow (type box2i): (0 0) - (35 180)",
        "compression (type compression): none",
        'spectralLayoutVersion (type string): "1.0"',
        'thetaDegrees (type string): "0+1*181"',
        'phiDegrees (type string): "0+10*36"',
        'method (type string): "patches, 1000 x 1000 rays"',
        'constant.shape (type string): "beard-chuang"',
        "seconds (type double): 12.3457",
        "refractiveIndexRe (type double): 1.34",
    )
    text = header_of(program, f"{folder}/matrix.exr")
    require(text, *(f"S{s}.486,666667nm, 32-bit floating-point" for s in range(4)))
    require(text, "compression (type compression): zip")


if __name__ == "__main__":
    globals()[sys.argv[1]](*sys.argv[2:])
