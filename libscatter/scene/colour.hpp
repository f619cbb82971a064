#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

/// From spectra to what is seen: CIE 1931 observer, sunlight, sRGB.
namespace scatter::scene {

/// Tristimulus values of the CIE 1931 standard observer (2 degrees).
struct Xyz {
  double X = 0, Y = 0, Z = 0;
};

/// Linear sRGB (IEC 61966-2-1 primaries, white D65). 1 is the display's white; values may leave [0, 1].
struct LinearRgb {
  double r = 0, g = 0, b = 0;
};

/// White of the standard illuminant D65: x = 0.3127, y = 0.3290, Y = 1.
[[nodiscard]] Xyz d65_white();

/// Colour-matching functions at a wavelength in vacuum [m], linear between the 5 nm rows of
/// tables/colour/cie_1931.csv and zero outside 360 .. 830 nm.
[[nodiscard]] Xyz colour_matching(double wavelength_m);

/// Sunlight outside the atmosphere, relative power per wavelength, 1 at 560 nm: a black body at 5772 K, the
/// nominal effective temperature of the sun (IAU 2015, resolution B3). Fraunhofer lines and the air's
/// reddening are left out; the observer is adapted to sunlight (SunlitColour), so that only the change of its
/// spectrum by the drop shows.
[[nodiscard]] double sunlight(double wavelength_m);

/// Weights w such that sum of w[i] * s[i] are the tristimulus values of light whose spectrum is s[i] *
/// light(lambda), s linear between the wavelengths [m], zero outside them. A single wavelength counts as a
/// line of its own: w is light * colour_matching there. Wavelengths in any order; a repeated one counts once.
/// Unit: that of light times metre.
[[nodiscard]] std::vector<Xyz>
tristimulus_weights(std::span<const double> wavelength_m, double (*light)(double));

[[nodiscard]] LinearRgb linear_rgb(const Xyz& colour);
[[nodiscard]] Xyz tristimulus(const LinearRgb& colour);

/// What an observer adapted to the white `from` sees, told in the colours of one adapted to `to` (Bradford
/// transform, as in ICC.1:2010, annex E).
[[nodiscard]] Xyz adapt(const Xyz& colour, const Xyz& from, const Xyz& to);

/// Into [0, 1]: a colour that the display's primaries cannot mix (a negative component) is moved towards the
/// grey of its own luminance, just as far as needed, so that lightness is kept and saturation lost; then what
/// is brighter than white is cut off per component, as in an overexposed photograph.
[[nodiscard]] LinearRgb into_gamut(const LinearRgb& colour);

/// The sRGB transfer curve: linear [0, 1] -> encoded [0, 1].
[[nodiscard]] double srgb_encode(double linear);

/// into_gamut, srgb_encode, 8 bits.
[[nodiscard]] std::array<std::uint8_t, 3> srgb_bytes(const LinearRgb& colour);

/// The colour of sunlight after scattering, from the scattering at a table's wavelengths. An observer adapted
/// to sunlight sees a scatterer that treats all wavelengths alike as white. With a single wavelength there is
/// no white: its own colour is shown, with luminance 1 for a value of 1.
class SunlitColour {
public:
  /// Wavelengths in vacuum [m], in the order in which the scattering will be given. Throws InputError when
  /// none of them can be seen.
  explicit SunlitColour(std::span<const double> wavelength_m);

  /// scattering: one value per wavelength, proportional to the scattered share of the light. Linear in it.
  /// Throws std::invalid_argument on another number of values.
  [[nodiscard]] LinearRgb operator()(std::span<const double> scattering) const;

private:
  std::vector<LinearRgb> weights_;
};

} // namespace scatter::scene
