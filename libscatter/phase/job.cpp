#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/optics/version.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/phase/methods.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <ctime>

namespace scatter::phase {

namespace {

/// Shortest text that reads back as the same number.
std::string number(double value) {
  return fmt::format("{}", value);
}

void check_list(
    const char* option, const std::vector<double>& values, double low, double high, const char* unit,
    double per_unit) {
  if (values.empty())
    throw InputError(fmt::format("{}: the list is empty; at least one value is needed", option));
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (!(values[i] >= low && values[i] <= high))
      throw InputError(fmt::format(
          "{}: {}{} is outside {} to {}{}", option, number(values[i] * per_unit), unit,
          number(low * per_unit), number(high * per_unit), unit));
    if (i > 0 && !(values[i] > values[i - 1]))
      throw InputError(fmt::format(
          "{}: the values must increase, but {}{} follows {}{}", option, number(values[i] * per_unit), unit,
          number(values[i - 1] * per_unit), unit));
  }
}

void check(const Request& request) {
  if (!(request.shape.radius_m > 0)) throw InputError("--radius: a positive length is needed, such as 0.5mm");
  check_list("--theta", request.theta_deg, 0, 180, "deg", 1);
  check_list("--phi", request.phi_deg, -360, 360, "deg", 1);
  if (request.wavelength_m.empty())
    throw InputError("--wavelengths: the list is empty; at least one is needed, such as 650nm");
  for (const double wavelength : request.wavelength_m)
    if (!(wavelength > 0 && std::isfinite(wavelength)))
      throw InputError(fmt::format("--wavelengths: {}m is not a positive length", number(wavelength)));
  if (!(request.sun_elevation_deg >= 0 && request.sun_elevation_deg <= 90))
    throw InputError(fmt::format(
        "--sun {}deg: the sun stands 0 to 90deg above the horizon", number(request.sun_elevation_deg)));
  // A smaller disc is a point to every table, and would be sampled at a step of its own size.
  if (request.sun_disc_deg != 0 && !(request.sun_disc_deg >= 0.01 && request.sun_disc_deg <= 10))
    throw InputError(fmt::format(
        "--sun-disc {}deg: an angular diameter of 0.01 to 10deg is needed, or 0deg for a point",
        number(request.sun_disc_deg)));
  if (request.rays < 2 || request.rays > 20000)
    throw InputError(fmt::format("--rays {}: the grid needs 2 to 20000 rays across", request.rays));
  if (request.threads < 0)
    throw InputError(fmt::format("--threads {}: 0 (all cores) or more is needed", request.threads));
  if (!(request.tolerance >= 0 && request.tolerance < 1))
    throw InputError(fmt::format(
        "--tolerance: {} is not a relative error; write one between 0 and 1, such as 0.01 or 1%",
        number(request.tolerance)));
  if (request.orders.empty()) throw InputError("--orders: at least one order is needed, such as 0..3");
  if (request.orders.front() < 0 || request.orders.back() > 1000)
    throw InputError("--orders: orders p from 0 to 1000 are possible");
}

std::string timestamp() {
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%dT%H:%M:%SZ", &utc);
  return text;
}

const char* diffraction_name(Diffraction diffraction) {
  switch (diffraction) {
  case Diffraction::gaussian:
    return "gaussian";
  case Diffraction::integral:
    return "integral";
  case Diffraction::none:
    break;
  }
  return "none";
}

std::string join(const std::vector<int>& values) {
  return fmt::format("{}", fmt::join(values, ","));
}

std::string focal_lines_name(FocalLines focal_lines) {
  switch (focal_lines) {
  case FocalLines::exact:
    return "exact";
  case FocalLines::rule:
    return "by rule";
  case FocalLines::none:
    break;
  }
  return "not counted";
}

table::TableHeader make_header(const Request& request, Method method) {
  table::TableHeader header;
  header.wavelength_m = request.wavelength_m;
  header.theta_deg = request.theta_deg;
  header.phi_deg = request.phi_deg;
  header.matrix = request.matrix;
  header.amplitudes = request.amplitudes;
  header.per_order = request.per_order;
  for (const double wavelength : request.wavelength_m) header.index.push_back(index_at(request, wavelength));
  table::Provenance& made = header.provenance;
  made.command = request.command;
  made.version = version();
  made.created = timestamp();
  const auto note = [&](const char* name, std::string value) {
    made.constants.emplace_back(name, std::move(value));
  };
  note("shape", request.shape.name);
  note("radius_m", number(request.shape.radius_m));
  note("axis_ratio", number(request.shape.axis_ratio()));
  note("sun_elevation_deg", number(request.sun_elevation_deg));
  note("index_source", index_source_name(request.index));
  note("sun_disc_deg", number(request.sun_disc_deg));
  if (!request.dispersion) note("dispersion", "off: index at 589.3 nm");
  if (!request.absorption) note("absorption", "off");
  if (method == Method::mie) {
    made.device = "host";
    made.method = "mie: Lorenz-Mie series of the sphere";
    return header;
  }
  header.orders = request.orders;
  made.method = fmt::format(
      "patches: {0} x {0} rays, orders {1}, diffraction {2}, focal lines {3}{4}", request.rays,
      join(request.orders), diffraction_name(request.diffraction), focal_lines_name(request.focal_lines),
      request.interference ? "" : ", no interference");
  note("rays", std::to_string(request.rays));
  note("orders", join(request.orders));
  if (request.diffraction == Diffraction::gaussian)
    note("gaussian_filter_sigma_deg", number(gaussian_filter_width_deg(request.shape.radius_m)));
  return header;
}

} // namespace

std::complex<double> index_at(const Request& request, double wavelength_m) {
  constexpr double sodium_d_m = 589.3e-9;
  const std::complex<double> index =
      refractive_index(request.index, request.dispersion ? wavelength_m : sodium_d_m);
  return request.absorption ? index : index.real();
}

namespace {

/// Rays need an index that bends them.
void check_index(const Plan& made) {
  for (const std::complex<double>& index : made.header.index) {
    if (made.method == Method::patches && (index.real() < 1.0001 || index.real() > 10))
      throw InputError(fmt::format(
          "--index {}: rays need a drop denser than the air around it, n from 1.0001 to 10; use --method mie "
          "for a sphere",
          number(index.real())));
    if (made.method == Method::patches && index.imag() > 0.1)
      throw InputError(fmt::format(
          "--index: k = {} is too strong an absorption for rays, which bend by the real part alone; up to "
          "0.1 is possible",
          number(index.imag())));
  }
}

/// Refuses what would not fit.
void count_memory(Plan& made) {
  const Request& request = made.request;
  const double table_bytes = sizeof(double) * static_cast<double>(request.theta_deg.size()) *
                             static_cast<double>(request.phi_deg.size()) *
                             (1.0 + (request.matrix ? 16 : 0) + (request.amplitudes ? 8 : 0) +
                              (request.per_order ? 8.0 * static_cast<double>(request.orders.size()) : 0));
  if (made.method == Method::mie) {
    made.memory_bytes = table_bytes + 1e8;
    made.description = fmt::format("Lorenz-Mie series, {} scattering angles", request.theta_deg.size());
  } else {
    // Refuse before anything large is allocated: the smallest such job holds its table once.
    if (table_bytes < made.available_bytes) {
      try {
        const compute::Device device(request.threads);
        const wavefront::Tracer tracer(tracing_of(request), device);
        made.header.provenance.device = device.info().name;
        made.memory_bytes = tracer.memory(request.wavelength_m.size(), wanted_of(request));
        made.description = fmt::format(
            "patches: {0} x {0} rays, orders {1}, {2}", request.rays, join(request.orders),
            tracer.describe(request.wavelength_m.size(), wanted_of(request)));
      } catch (const compute::DeviceError& error) {
        throw InputError(error.what());
      }
    } else {
      made.memory_bytes = table_bytes;
    }
  }
  if (made.memory_bytes > made.available_bytes)
    throw InputError(fmt::format(
        "this request needs about {:.1f} GB of memory and {:.1f} GB are free: ask for fewer --theta or "
        "--phi, or without --matrix, --amplitudes, --per-order",
        made.memory_bytes / 1e9, made.available_bytes / 1e9));
}

/// What is asked for that Mie does not have; nullptr: nothing.
const char* option_of_patches(const Request& request) {
  if (!request.open.diffraction) return "--diffraction";
  if (!request.open.orders) return "--orders";
  if (!request.open.rays) return "--rays";
  if (!request.open.focal_lines) return "--focal-lines";
  if (!request.interference) return "--no-interference";
  return request.per_order ? "--per-order" : nullptr;
}

/// Settings are tried before memory is counted, and need a device, too.
Choice chosen(const Request& request, RequestErrors& errors) {
  try {
    return choose_settings(request, errors);
  } catch (const compute::DeviceError& error) {
    throw InputError(error.what());
  }
}

} // namespace

Plan plan(const Request& request) {
  check(request);
  Plan made;
  made.request = request;
  made.available_bytes = static_cast<double>(compute::available_memory());
  const bool sphere = request.shape.is_sphere();
  made.method = request.method;
  const char* const of_patches = option_of_patches(request);
  if (made.method == Method::automatic)
    made.method = sphere && of_patches == nullptr ? Method::mie : Method::patches;
  if (made.method == Method::mie) {
    if (!sphere)
      throw InputError(fmt::format(
          "--method mie: only a sphere has a Lorenz-Mie series, this drop is a {}; use --method patches",
          request.shape.name));
    if (of_patches != nullptr)
      throw InputError(fmt::format("--method mie: {} is for --method patches; drop one of them", of_patches));
  }
  if (request.tolerance > 0 && made.method == Method::mie)
    made.reasons = "a sphere has an exact theory: Lorenz-Mie, to 1e-9";
  if (made.method == Method::patches && request.diffraction == Diffraction::integral) {
    if (!request.interference)
      throw InputError("--diffraction integral: intensities cannot be integrated; drop --no-interference");
    if (request.focal_lines != FocalLines::exact)
      throw InputError(
          "--diffraction integral: focal lines must be counted exactly; use --focal-lines exact");
    if (!integral_fits(request))
      throw InputError(fmt::format(
          "--diffraction integral: a drop of radius {} m is too small for order 0 at its longest wavelength; "
          "use a "
          "size parameter of {:g} or more, or orders from 1 on",
          number(request.shape.radius_m), wavefront::smallest_size_with_shadow));
  }
  if (made.method == Method::patches && !request.interference && (request.amplitudes || request.per_order))
    throw InputError("--no-interference: intensities have no amplitude; drop --amplitudes and --per-order");
  made.header = make_header(request, made.method);
  check_index(made);
  if (made.method == Method::patches)
    made.errors = std::make_shared<RequestErrors>(request, made.header.index);
  if (request.tolerance > 0 && made.method == Method::patches) {
    Choice choice = chosen(request, *made.errors);
    made.request = std::move(choice.request);
    made.reasons = std::move(choice.explanation);
    made.header = make_header(made.request, made.method);
    made.header.provenance.constants.emplace_back("tolerance", number(request.tolerance));
  }
  count_memory(made);
  return made;
}

Prediction predict(const Plan& plan) {
  if (plan.method == Method::mie) {
    // The coefficients' sums over partial waves by FFT, where angles allow it; otherwise some ten times that.
    const Request& request = plan.request;
    double seconds = 0;
    for (const double wavelength : request.wavelength_m)
      seconds += 2 * pi * request.shape.radius_m / wavelength *
                 (1e-7 + 3e-10 * static_cast<double>(request.theta_deg.size()) *
                             (request.sun_disc_deg > 0 ? 30 : 1));
    return {1e-9, seconds, 0.05, 0, 0};
  }
  try {
    return predict(plan.request, *plan.errors);
  } catch (const compute::DeviceError& error) {
    throw RunError(error.what());
  }
}

void ErrorSum::add(std::span<const double> errors) {
  for (const double error : errors) squares_ += error * error;
  count_ += errors.size();
}

double ErrorSum::root_mean_square() const {
  return count_ == 0 ? 0 : std::sqrt(squares_ / static_cast<double>(count_));
}

Outcome run(const Plan& plan, table::Sink& sink, const Progress& progress) {
  return plan.method == Method::mie ? run_mie(plan, sink, progress) : run_patches(plan, sink, progress);
}

table::PhaseTable compute(const Request& request) {
  table::MemorySink sink;
  run(plan(request), sink);
  return std::move(sink.table);
}

} // namespace scatter::phase
