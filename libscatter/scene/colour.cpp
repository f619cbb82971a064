#include <scatter/optics/data_table.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/scene/colour.hpp>

#include <embedded/colour_cie_1931.hpp>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

namespace scatter::scene {
namespace {

using Vector = std::array<double, 3>;
using Matrix = std::array<Vector, 3>;

Vector multiply(const Matrix& m, const Vector& v) {
  Vector out{};
  for (std::size_t i = 0; i < 3; ++i) out[i] = m[i][0] * v[0] + m[i][1] * v[1] + m[i][2] * v[2];
  return out;
}

Matrix inverse(const Matrix& m) {
  Matrix out{};
  for (std::size_t i = 0; i < 3; ++i)
    for (std::size_t j = 0; j < 3; ++j) {
      const std::size_t a = (j + 1) % 3, b = (j + 2) % 3, c = (i + 1) % 3, d = (i + 2) % 3;
      out[i][j] = m[a][c] * m[b][d] - m[a][d] * m[b][c];
    }
  const double determinant = m[0][0] * out[0][0] + m[0][1] * out[1][0] + m[0][2] * out[2][0];
  for (Vector& row : out)
    for (double& value : row) value /= determinant;
  return out;
}

Vector from_chromaticity(double x, double y) {
  return {x / y, 1, (1 - x - y) / y};
}

/// Columns are the primaries, scaled so that (1, 1, 1) is white.
const Matrix& rgb_to_xyz() {
  static const Matrix matrix = [] {
    const Vector red = from_chromaticity(0.64, 0.33), green = from_chromaticity(0.30, 0.60),
                 blue = from_chromaticity(0.15, 0.06);
    Matrix primaries{};
    for (std::size_t i = 0; i < 3; ++i) primaries[i] = {red[i], green[i], blue[i]};
    const Vector share = multiply(inverse(primaries), from_chromaticity(0.3127, 0.3290));
    for (Vector& row : primaries)
      for (std::size_t j = 0; j < 3; ++j) row[j] *= share[j];
    return primaries;
  }();
  return matrix;
}

const Matrix& xyz_to_rgb() {
  static const Matrix matrix = inverse(rgb_to_xyz());
  return matrix;
}

constexpr Matrix bradford{{{0.8951, 0.2664, -0.1614}, {-0.7502, 1.7135, 0.0367}, {0.0389, -0.0685, 1.0296}}};

} // namespace

Xyz d65_white() {
  const Vector white = from_chromaticity(0.3127, 0.3290);
  return {white[0], white[1], white[2]};
}

Xyz colour_matching(double wavelength_m) {
  static const DataTable table = parse_data_table(embedded::colour_cie_1931);
  const double nanometres = wavelength_m * 1e9;
  if (!(nanometres >= table.rows.front()[0] && nanometres <= table.rows.back()[0])) return {};
  const std::vector<double> row = table.interpolate(nanometres);
  return {row[0], row[1], row[2]};
}

double sunlight(double wavelength_m) {
  constexpr double second_radiation_constant = 1.438776877e-2; // m K, h c / k (SI 2019)
  constexpr double temperature = 5772;                         // K
  const auto planck = [](double wavelength) {
    return std::pow(wavelength, -5) / std::expm1(second_radiation_constant / (wavelength * temperature));
  };
  return planck(wavelength_m) / planck(560e-9);
}

std::vector<Xyz> tristimulus_weights(std::span<const double> wavelength_m, double (*light)(double)) {
  std::vector<Xyz> weights(wavelength_m.size());
  if (wavelength_m.empty()) return weights;
  std::vector<std::size_t> order(wavelength_m.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return wavelength_m[a] < wavelength_m[b];
  });
  const auto add = [&](std::size_t to, double weight, double wavelength) {
    const Xyz matching = colour_matching(wavelength);
    weight *= light(wavelength);
    weights[to].X += weight * matching.X;
    weights[to].Y += weight * matching.Y;
    weights[to].Z += weight * matching.Z;
  };
  if (wavelength_m[order.front()] == wavelength_m[order.back()]) {
    add(order.front(), 1, wavelength_m[order.front()]);
    return weights;
  }
  for (std::size_t i = 1; i < order.size(); ++i) {
    const double first = wavelength_m[order[i - 1]], last = wavelength_m[order[i]];
    // Midpoints of steps of a quarter nanometre at most: far finer than the 5 nm of the observer's table.
    const auto steps = static_cast<int>(std::min(std::ceil((last - first) / 0.25e-9), 1e6));
    for (int s = 0; s < steps; ++s) {
      const double share = (s + 0.5) / steps, wavelength = first + share * (last - first);
      const double width = (last - first) / steps;
      add(order[i - 1], (1 - share) * width, wavelength);
      add(order[i], share * width, wavelength);
    }
  }
  return weights;
}

LinearRgb linear_rgb(const Xyz& colour) {
  const Vector rgb = multiply(xyz_to_rgb(), {colour.X, colour.Y, colour.Z});
  return {rgb[0], rgb[1], rgb[2]};
}

Xyz tristimulus(const LinearRgb& colour) {
  const Vector xyz = multiply(rgb_to_xyz(), {colour.r, colour.g, colour.b});
  return {xyz[0], xyz[1], xyz[2]};
}

Xyz adapt(const Xyz& colour, const Xyz& from, const Xyz& to) {
  static const Matrix back = inverse(bradford);
  Vector cones = multiply(bradford, {colour.X, colour.Y, colour.Z});
  const Vector before = multiply(bradford, {from.X, from.Y, from.Z}),
               after = multiply(bradford, {to.X, to.Y, to.Z});
  for (std::size_t i = 0; i < 3; ++i) cones[i] *= after[i] / before[i];
  const Vector xyz = multiply(back, cones);
  return {xyz[0], xyz[1], xyz[2]};
}

LinearRgb into_gamut(const LinearRgb& colour) {
  const double grey = tristimulus(colour).Y;
  const double lowest = std::min({colour.r, colour.g, colour.b});
  LinearRgb out = colour;
  if (grey <= 0) return {};
  if (lowest < 0) {
    const double keep = grey / (grey - lowest); // brings the lowest component to zero exactly
    out = {grey + keep * (colour.r - grey), grey + keep * (colour.g - grey), grey + keep * (colour.b - grey)};
  }
  return {std::clamp(out.r, 0.0, 1.0), std::clamp(out.g, 0.0, 1.0), std::clamp(out.b, 0.0, 1.0)};
}

double srgb_encode(double linear) {
  return linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055;
}

std::array<std::uint8_t, 3> srgb_bytes(const LinearRgb& colour) {
  const LinearRgb inside = into_gamut(colour);
  const auto byte = [](double value) {
    return static_cast<std::uint8_t>(std::lround(255 * srgb_encode(value)));
  };
  return {byte(inside.r), byte(inside.g), byte(inside.b)};
}

SunlitColour::SunlitColour(std::span<const double> wavelength_m) {
  const std::vector<Xyz> weights = tristimulus_weights(wavelength_m, sunlight);
  Xyz white;
  int seen = 0;
  for (const Xyz& w : weights) {
    white = {white.X + w.X, white.Y + w.Y, white.Z + w.Z};
    seen += w.Y > 0;
  }
  if (!(white.Y > 0))
    throw InputError("none of the wavelengths can be seen; a colour needs some between 360nm and 830nm");
  const bool alone = seen == 1;
  for (const Xyz& w : weights) {
    const Xyz relative{w.X / white.Y, w.Y / white.Y, w.Z / white.Y};
    const Xyz sun{white.X / white.Y, 1, white.Z / white.Y};
    weights_.push_back(linear_rgb(alone ? relative : adapt(relative, sun, d65_white())));
  }
}

LinearRgb SunlitColour::operator()(std::span<const double> scattering) const {
  if (scattering.size() != weights_.size()) throw std::invalid_argument("one value per wavelength is needed");
  LinearRgb sum;
  for (std::size_t i = 0; i < weights_.size(); ++i) {
    sum.r += weights_[i].r * scattering[i];
    sum.g += weights_[i].g * scattering[i];
    sum.b += weights_[i].b * scattering[i];
  }
  return sum;
}

} // namespace scatter::scene
