#include "sphere_orders.hpp"

#include <scatter/exact/debye.hpp>
#include <scatter/optics/units.hpp>
#include <scatter/phase/job.hpp>

#include <chrono>
#include <cmath>
#include <stdexcept>

namespace scatter::validation {

namespace {

using Amplitudes = std::vector<std::complex<double>>;

double seconds_since(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

Curve intensity(const Amplitudes& S1, const Amplitudes& S2, double size_parameter) {
  const double scale = 1 / (2 * pi * size_parameter * size_parameter); // 1 / (2 k^2 pi a^2)
  Curve curve;
  for (std::size_t i = 0; i < S1.size(); ++i) {
    const double parallel = std::norm(S2[i]), perpendicular = std::norm(S1[i]);
    curve.s11.push_back(scale * (parallel + perpendicular));
    curve.s12.push_back(scale * (parallel - perpendicular));
  }
  return curve;
}

double size_parameter(const phase::Request& request) {
  return 2 * pi * request.shape.radius_m / request.wavelength_m.front();
}

} // namespace

Curve SphereOrders::up_to(int last) const {
  Amplitudes first(S1.front().size()), second(first.size());
  for (int p = 0; p <= last; ++p) {
    if (orders.at(static_cast<std::size_t>(p)) != p)
      throw std::logic_error("SphereOrders::up_to: an order is missing");
    for (std::size_t i = 0; i < first.size(); ++i) {
      first[i] += S1[static_cast<std::size_t>(p)][i];
      second[i] += S2[static_cast<std::size_t>(p)][i];
    }
  }
  return intensity(first, second, size_parameter);
}

Curve SphereOrders::whole() const {
  return intensity(whole_S1, whole_S2, size_parameter);
}

SphereOrders traced_orders(phase::Request request, const std::vector<double>& theta_deg) {
  request.method = phase::Method::patches;
  request.wavelength_m.resize(1);
  request.theta_deg = theta_deg;
  request.phi_deg = {0};
  request.amplitudes = request.per_order = true;
  // The first job of its kind compiles its kernels; later ones, of any size, find them in the driver's cache.
  phase::Request small = request;
  small.rays = 16;
  small.theta_deg = {138};
  small.orders = {2};
  (void)phase::compute(small);
  SphereOrders found;
  found.size_parameter = size_parameter(request);
  found.orders = request.orders;
  const auto start = std::chrono::steady_clock::now();
  const table::PhaseTable table = phase::compute(request);
  found.seconds = seconds_since(start);
  const std::vector<table::Amplitude>& all = table.slabs.front().order_amplitude;
  const std::size_t angles = theta_deg.size();
  for (std::size_t p = 0; p < request.orders.size(); ++p) {
    Amplitudes first, second;
    for (std::size_t t = 0; t < angles; ++t) {
      first.push_back(all[p * angles + t].S1);
      second.push_back(all[p * angles + t].S2);
    }
    found.S1.push_back(std::move(first));
    found.S2.push_back(std::move(second));
  }
  return found;
}

SphereOrders exact_orders(const phase::Request& request, const std::vector<double>& theta_deg) {
  SphereOrders found;
  found.size_parameter = size_parameter(request);
  found.orders = request.orders;
  const auto start = std::chrono::steady_clock::now();
  exact::DebyeResult debye = exact::debye_at_degrees(
      found.size_parameter, refractive_index(request.index, request.wavelength_m.front()), request.orders,
      theta_deg, request.threads);
  found.seconds = seconds_since(start);
  for (exact::DebyeOrder& order : debye.orders) {
    found.S1.push_back(std::move(order.S1));
    found.S2.push_back(std::move(order.S2));
  }
  found.whole_S1 = std::move(debye.whole.S1);
  found.whole_S2 = std::move(debye.whole.S2);
  return found;
}

std::vector<double> sizes(const Amplitudes& S1, const Amplitudes& S2) {
  std::vector<double> found;
  for (std::size_t i = 0; i < S1.size(); ++i) found.push_back(std::hypot(std::abs(S1[i]), std::abs(S2[i])));
  return found;
}

std::vector<double> differences(const SphereOrders& found, const SphereOrders& truth, std::size_t order) {
  std::vector<double> error;
  for (std::size_t i = 0; i < truth.S1[order].size(); ++i)
    error.push_back(std::hypot(
        std::abs(found.S1[order][i] - truth.S1[order][i]),
        std::abs(found.S2[order][i] - truth.S2[order][i])));
  return error;
}

} // namespace scatter::validation
