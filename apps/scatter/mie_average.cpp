// `scatter mie` for more than one sphere, one wavelength or one direction of the light.
#include "mie_average.hpp"

#include "exact_options.hpp"
#include <scatter/drop/size_distribution.hpp>
#include <scatter/exact/average.hpp>
#include <scatter/exact/mie.hpp>
#include <scatter/exact/sun_disc.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/refractive_index.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/scene/colour.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <iostream>
#include <vector>

namespace scatter::app {
namespace {

/// What one average asks for, and what its file says about it.
struct Request {
  drop::SizeDistribution sizes;
  exact::AverageRequest average;
  Constants constants;
  /// The largest sphere's size parameter with its option, where it is beyond what was compared with 60
  /// digits.
  std::string not_validated;
};

std::pair<double, double> parse_band(const std::string& text) {
  const auto colon = text.find(':');
  if (colon == std::string::npos || text.find(':', colon + 1) != std::string::npos)
    throw InputError(quote(text) + " is not a band; write first:last, such as 500nm:600nm");
  // A unit at the end holds for both, as in ranges.
  const std::string last = text.substr(colon + 1);
  std::string first = text.substr(0, colon);
  if (!first.empty() && first.find_first_not_of("0123456789.") == std::string::npos) {
    const auto unit = last.find_first_not_of("0123456789.");
    if (unit != std::string::npos) first.append(last, unit);
  }
  const std::pair band{parse_length(first), parse_length(last)};
  if (!(band.first < band.second))
    throw InputError(quote(text) + " ends before it starts; write first:last, such as 500nm:600nm");
  return band;
}

Request parse(const AverageTexts& average, const SphereTexts& sphere) {
  if (sphere.orders)
    throw InputError("--orders: Debye terms are not averaged; leave it out for the whole sum");
  if (sphere.body.size_parameter)
    throw InputError(
        "--size-parameter: an average needs lengths; use --radius 10um or --distribution, and --wavelength "
        "650nm or --band");
  if (sphere.body.radius && average.distribution)
    throw InputError("--radius: --distribution says the radii already; give one of the two");
  if (!sphere.body.radius && !average.distribution)
    throw InputError("the size is missing: use --radius 0.4mm, or --distribution such as "
                     "lognormal:median=10um,sigma=1.3");
  if (sphere.body.wavelength && average.band)
    throw InputError("--wavelength: --band says the wavelengths already; give one of the two");
  if (!sphere.body.wavelength && !average.band)
    throw InputError("the wavelength is missing: use --wavelength 650nm or --band 500nm:600nm");
  if (average.band_weight && !average.band)
    throw InputError("--band-weight: there is no --band to weigh; add one such as 500nm:600nm");

  Request request{
      average.distribution
          ? read("--distribution", *average.distribution, drop::parse_size_distribution)
          : drop::SizeDistribution::list({read("--radius", *sphere.body.radius, parse_length)}, {1}),
      {},
      {},
      {}};
  exact::AverageRequest& wanted = request.average;
  const auto constant = [&](const char* name, const std::string& value) {
    request.constants.emplace_back(name, value);
  };
  if (average.distribution) {
    constant(
        "distribution", request.sizes.kind() == drop::SizeDistribution::Kind::list ? *average.distribution
                                                                                   : request.sizes.name());
  } else {
    constant("radius_m", fmt::format("{}", request.sizes.radius_m()[0]));
  }

  if (average.band) {
    std::tie(wanted.band.first_m, wanted.band.last_m) = read("--band", *average.band, parse_band);
    const std::string weight = average.band_weight.value_or("uniform");
    if (weight == "sunlight")
      wanted.band.weight = scene::sunlight;
    else if (weight != "uniform")
      throw InputError("--band-weight: " + quote(weight) + " is not known; use uniform or sunlight");
    constant("band_m", fmt::format("{}:{}", wanted.band.first_m, wanted.band.last_m));
    constant("band_weight", weight);
  } else {
    wanted.band.first_m = wanted.band.last_m = read("--wavelength", *sphere.body.wavelength, parse_length);
    constant("wavelength_m", fmt::format("{}", wanted.band.first_m));
  }

  const IndexSource source = read("--index", sphere.body.index.value_or("iapws"), parse_index_source);
  for (const double end : {wanted.band.first_m, wanted.band.last_m}) try {
      if (refractive_index(source, end) == 1.0)
        throw InputError("--index: index 1 is no sphere: nothing is scattered; use an index other than 1");
    } catch (const InputError& error) {
      if (source.kind == IndexSource::Kind::given) throw;
      throw InputError(std::string(average.band ? "--band: " : "--wavelength: ") + error.what());
    }
  wanted.index = [source](double wavelength_m) { return refractive_index(source, wavelength_m); };
  constant("index", index_source_name(source));

  if (average.sun_disc) {
    wanted.sun_disc_deg = read("--sun-disc", *average.sun_disc, parse_angle_deg);
    if (!(wanted.sun_disc_deg > 0 && wanted.sun_disc_deg <= 60))
      throw InputError(
          "--sun-disc: " + quote(*average.sun_disc) +
          " is outside 0deg..60deg; the sun's diameter seen from the Earth is 0.533deg");
    constant("sun_disc_deg", fmt::format("{}", wanted.sun_disc_deg));
  }
  if (average.tolerance) {
    wanted.tolerance = read("--tolerance", *average.tolerance, parse_number);
    if (!(wanted.tolerance >= 1e-10 && wanted.tolerance <= 1))
      throw InputError(
          "--tolerance: " + quote(*average.tolerance) + " is outside 1e-10..1; use one such as 1e-2");
  }
  constant("tolerance", fmt::format("{}", wanted.tolerance));
  if (average.spheres)
    wanted.most_spheres =
        static_cast<std::size_t>(whole_number("--spheres", *average.spheres, 1, 1000000000));
  wanted.theta_deg = read("--angles", sphere.angles, parse_angles_deg);
  for (const double angle : wanted.theta_deg)
    if (!(angle >= 0 && angle <= 180))
      throw InputError(fmt::format("--angles: {} deg is outside 0deg..180deg", angle));
  wanted.threads = thread_count(sphere.threads);

  // The tails that are left out must not show next to the tolerance.
  const double share = std::min(1e-5, 1e-3 * wanted.tolerance);
  const auto [smallest, largest] = request.sizes.range(share);
  if (request.sizes.kind() == drop::SizeDistribution::Kind::list) {
    wanted.radii.radius_m = request.sizes.radius_m();
    wanted.radii.number = request.sizes.number();
  } else {
    wanted.radii.density = [sizes = request.sizes](double radius) { return sizes.density(radius); };
    wanted.radii.smallest_m = smallest;
    wanted.radii.largest_m = largest;
    wanted.radii.fades = !request.sizes.is_cut();
  }
  const char* const size_option = average.distribution ? "--distribution" : "--radius";
  for (const auto& [radius, wavelength] :
       {std::pair(smallest, wanted.band.last_m), std::pair(largest, wanted.band.first_m)}) {
    const double x = 2 * pi * radius / wavelength;
    if (!(x >= 1e-6 && x <= 5e5))
      throw InputError(fmt::format(
          "{}: radius {:.6g} um has the size parameter {:.3g} at {:.6g} nm, outside 1e-6..5e5; use {} "
          "radii{}",
          size_option, radius * 1e6, x, wavelength * 1e9, x < 1 ? "larger" : "smaller",
          average.distribution ? ", or cut the distribution with from= and to=" : ""));
    if (x > exact::mie_validated_size_parameter)
      request.not_validated = fmt::format("{}: the largest size parameter {:.9g}", size_option, x);
  }
  return request;
}

/// Numbers of the whole average, in the order in which both formats tell them.
std::vector<std::pair<const char*, double>> bulk(const Request& request, const exact::Average& result) {
  std::vector<std::pair<const char*, double>> list{
      {"Cext_m2", result.C_ext},
      {"Csca_m2", result.C_sca},
      {"Cabs_m2", result.C_abs},
      {"Qext", result.Q_ext},
      {"Qsca", result.Q_sca},
      {"Qabs", result.Q_abs},
      {"g", result.g},
      {"effective_radius_m", result.effective_radius_m},
      {"effective_variance", result.effective_variance}};
  if (const double number = request.sizes.number_per_m3(); number > 0) {
    list.emplace_back("number_per_m3", number);
    list.emplace_back("extinction_per_m", number * result.C_ext);
  }
  return list;
}

std::string
json_text(const Request& request, const exact::Average& result, double seconds, const std::string& command) {
  nlohmann::ordered_json json;
  for (const auto& [name, value] : bulk(request, result)) json[name] = value;
  json["theta_deg"] = request.average.theta_deg;
  json["phase_function"] = result.S11;
  json["mueller"] = {{"S11", result.S11}, {"S12", result.S12}, {"S33", result.S33}, {"S34", result.S34}};
  json["phase_function_error"] = result.error_estimate;
  json["bulk_error"] = result.bulk_error;
  json["error_estimate"] = result.largest_error;
  json["converged"] = result.converged;
  json["validated"] = request.not_validated.empty();
  json["spheres"] = result.spheres;
  json["method"] = "Lorenz-Mie average";
  json["seconds"] = seconds;
  return finish_json(std::move(json), request.constants, command);
}

std::string
csv_text(const Request& request, const exact::Average& result, double seconds, const std::string& command) {
  fmt::memory_buffer text;
  const auto add = [&]<typename... Values>(fmt::format_string<Values...> format, Values&&... values) {
    fmt::format_to(std::back_inserter(text), format, std::forward<Values>(values)...);
  };
  add("# Lorenz-Mie scattering averaged over spheres; Mueller matrix of Bohren & Huffman, normalised\n");
  add("{}", csv_provenance(request.constants, seconds, command));
  for (const auto& [name, value] : bulk(request, result)) add("# {}: {}\n", name, value);
  add("# bulk_error: {}\n# error_estimate: {}\n# converged: {}\n# spheres: {}\n", result.bulk_error,
      result.largest_error, result.converged, result.spheres);
  add("# phase_function = S11 in sr^-1, integral over the sphere 1; polarization = -S12/S11 for unpolarised "
      "light; error as a share of S11\n");
  add("theta_deg,phase_function,S12,S33,S34,polarization,error\n");
  for (std::size_t i = 0; i < result.S11.size(); ++i)
    add("{},{},{},{},{},{},{}\n", request.average.theta_deg[i], result.S11[i], result.S12[i], result.S33[i],
        result.S34[i], result.S11[i] > 0 ? (0 - result.S12[i]) / result.S11[i] : 0.0,
        result.error_estimate[i]);
  return fmt::to_string(text);
}

} // namespace

void add_average_options(CLI::App& verb, AverageTexts& texts) {
  const auto add = [&](const char* name, auto& text, const char* type, const std::string& description) {
    verb.add_option(name, text, description)->type_name(type)->group("Average");
  };
  add("--distribution", texts.distribution, "SIZES",
      "Instead of --radius: lognormal:median=10um,sigma=1.3, gamma:mu=2,lambda=3/mm, "
      "gamma:effective-radius=10um,effective-variance=0.1, marshall-palmer:rate=5mm/h (from=, to=: only "
      "radii between), list:FILE (lines such as 10um,0.5)");
  add("--sun-disc", texts.sun_disc, "ANGLE",
      fmt::format("Mean over the sun's disc of this diameter, such as {}deg", exact::sun_diameter_deg));
  add("--band", texts.band, "FIRST:LAST", "Instead of --wavelength: mean over a band, such as 500nm:600nm");
  add("--band-weight", texts.band_weight, "WEIGHT", "uniform or sunlight (black body, 5772 K) [uniform]");
  add("--tolerance", texts.tolerance, "T", "Error wanted, as a share of S11 at every angle [1e-3]");
  add("--spheres", texts.spheres, "N", "Stop at so many spheres, come what may [200000]");
}

void run_average(const AverageTexts& average, const SphereTexts& sphere, const Context& context) {
  Request request = parse(average, sphere);
  ExactOutput output(sphere.output);

  request.average.progress = [](std::size_t spheres, double error) {
    spdlog::info("{} spheres, error estimate {:.2g}", spheres, error);
  };
  const auto start = std::chrono::steady_clock::now();
  const exact::Average result = exact::average(request.average);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  spdlog::info(
      "{} spheres x {} angles, {:.3g} s, error estimate {:.1e}", result.spheres, result.S11.size(), seconds,
      result.largest_error);
  // The file says so too; the work is not thrown away.
  if (!result.converged)
    std::cerr << fmt::format(
        "scatter mie: the error estimate is {:.2g}, above --tolerance {:.2g}, after {} spheres; allow more "
        "with --spheres or a larger tolerance\n",
        result.largest_error, request.average.tolerance, result.spheres);
  if (!request.not_validated.empty())
    tell_not_validated("mie", request.not_validated, exact::mie_validated_size_parameter, "results", 60);

  output.write(
      output.is_csv() ? csv_text(request, result, seconds, context.command_line)
                      : json_text(request, result, seconds, context.command_line));
}

} // namespace scatter::app
