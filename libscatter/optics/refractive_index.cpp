#include <scatter/optics/data_table.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>

#include <embedded/water_hale_querry.hpp>

#include <charconv>
#include <cmath>
#include <sstream>

namespace scatter {
namespace {

std::string shortest(double value) {
  char buffer[32];
  return {buffer, std::to_chars(buffer, buffer + sizeof buffer, value).ptr};
}

/// Refuses what lies outside [low, high]; ends may be missed by rounding (a wavelength typed in nm).
void check_range(
    const char* source, const char* what, double value, double low, double high, double unit,
    const char* unit_name) {
  constexpr double slack = 1e-12;
  if (value >= low * (1 - slack) && value <= high * (1 + slack)) return;
  std::ostringstream message;
  message << what << ' ' << value / unit << ' ' << unit_name << " is outside the data of " << source << ": "
          << low / unit << ".." << high / unit << ' ' << unit_name;
  throw InputError(message.str());
}

constexpr double nm = 1e-9;
constexpr double um = 1e-6;

} // namespace

IndexSource parse_index_source(std::string_view text) {
  using Kind = IndexSource::Kind;
  for (const auto kind : {Kind::hale_querry, Kind::iapws, Kind::daimon_masumura})
    if (text == index_source_name({kind, {}})) return {kind, {}};
  const bool numeric = !text.empty() && text.find_first_of("0123456789+-.") == 0;
  if (numeric) return {Kind::given, parse_index(text)};
  throw InputError(
      "index " + quote(text) +
      " is not known: use hale-querry, iapws, daimon-masumura, or a number such as 1.333 or 1.33+1e-9i");
}

std::string index_source_name(const IndexSource& source) {
  switch (source.kind) {
  case IndexSource::Kind::hale_querry:
    return "hale-querry";
  case IndexSource::Kind::iapws:
    return "iapws";
  case IndexSource::Kind::daimon_masumura:
    return "daimon-masumura";
  case IndexSource::Kind::given:
    break;
  }
  const double k = source.value.imag();
  std::string name = shortest(source.value.real());
  if (k != 0) name.append(k > 0 ? "+" : "").append(shortest(k)).append("i");
  return name;
}

std::complex<double> refractive_index(const IndexSource& source, double wavelength_m) {
  switch (source.kind) {
  case IndexSource::Kind::hale_querry:
    return hale_querry_index(wavelength_m);
  case IndexSource::Kind::iapws:
    // Water at 20 C and 0.101325 MPa has 998.2071 kg/m3 (IAPWS-95).
    return iapws_index(wavelength_m, 293.15, 998.2071);
  case IndexSource::Kind::daimon_masumura:
    return daimon_masumura_index(wavelength_m);
  case IndexSource::Kind::given:
    break;
  }
  return source.value;
}

double hale_querry_index(double wavelength_m) {
  static const DataTable table = parse_data_table(embedded::water_hale_querry);
  check_range(
      "hale-querry", "wavelength", wavelength_m, table.rows.front()[0] * nm, table.rows.back()[0] * nm, nm,
      "nm");
  return table.interpolate(wavelength_m / nm)[0];
}

double iapws_index(double wavelength_m, double temperature_K, double density_kg_m3) {
  check_range("iapws", "wavelength", wavelength_m, 200 * nm, 1100 * nm, nm, "nm");
  check_range("iapws", "temperature", temperature_K, 261.15, 773.15, 1, "K");
  check_range("iapws", "density", density_kg_m3, 0, 1060, 1, "kg/m3");
  // IAPWS R9-97, eq. 1 and table 1; reduced by 273.15 K, 1000 kg/m3 and 0.589 um.
  const double temperature = temperature_K / 273.15;
  const double density = density_kg_m3 / 1000;
  const double wavelength = wavelength_m / (0.589 * um);
  const double square = wavelength * wavelength;
  constexpr double ultraviolet = 0.2292020, infrared = 5.432937;
  const double polarisability = 0.244257733 + 9.74634476e-3 * density - 3.73234996e-3 * temperature +
                                2.68678472e-4 * square * temperature + 1.58920570e-3 / square +
                                2.45934259e-3 / (square - ultraviolet * ultraviolet) +
                                0.900704920 / (square - infrared * infrared) -
                                1.66626219e-2 * density * density;
  const double lorentz_lorenz = density * polarisability; // (n^2 - 1) / (n^2 + 2)
  return std::sqrt((1 + 2 * lorentz_lorenz) / (1 - lorentz_lorenz));
}

double daimon_masumura_index(double wavelength_m) {
  check_range("daimon-masumura", "wavelength", wavelength_m, 182 * nm, 1129 * nm, nm, "nm");
  constexpr double strength[] = {.5684027565, .1726177391, .02086189578, .1130748688};
  constexpr double resonance_um2[] = {.005101829712, .01821153936, .02620722293, 10.69792721};
  const double wavelength_um = wavelength_m / um;
  const double square = wavelength_um * wavelength_um;
  double permittivity = 1;
  for (int i = 0; i < 4; ++i) permittivity += strength[i] * square / (square - resonance_um2[i]);
  return std::sqrt(permittivity);
}

} // namespace scatter
