#include <scatter/optics/units.hpp>
#include <scatter/wavefront/references.hpp>

#include <algorithm>
#include <cmath>
#include <ranges>

namespace scatter::wavefront {
namespace {

/// The momentum grows with the angle of incidence at least by the first share of what it does on a sphere,
/// and nothing is gained beyond the second.
constexpr double slowest_momentum = 0.05, fast_enough = 0.3;
/// A twist of 1 costs as much as momenta that change by this much, in units of a sphere's, otherwise than
/// they should.
constexpr double cost_of_twist = 0.2;

} // namespace

References::References(
    std::span<const Ring> rings, const Places& places, const Outline& outline, std::vector<RimBend> rim,
    double ka)
    : steepest_(1.3 * places.steepest), rim_(std::move(rim)) {
  for (std::size_t r = 0; r < places.first_beyond; ++r) {
    const Ring& ring = rings[r];
    const double alpha = places.at[r], from_rim = 0.5 * pi - alpha;
    if (ring.state() == Ring::State::none || places.step[r] == 0) continue;
    for (int knot = 0; knot < knots; ++knot) {
      // Between the two rays around it.
      const int azimuths = ring.azimuths();
      const Ring::Bracket around = ring.around(2 * pi * knot / knots);
      const double share = (around.guess - around.low) / (around.high - around.low);
      Change change{from_rim};
      bool tunnels = false;
      for (const auto& [psi, part] : {std::pair{around.low, 1 - share}, {around.high, share}}) {
        const int j = static_cast<int>(std::lrint(psi / (2 * pi) * azimuths)) % azimuths;
        tunnels = tunnels || ring.sample(foci, j) < 0;
        const double radius = series_value(outline.radius, std::cos(psi));
        // Incident area per angle and azimuth; determinants are of (.., azimuth) by the impact point. Beyond
        // the axis a sphere's momentum is negative.
        const double area = radius * radius * std::sin(alpha) * std::cos(alpha);
        const double unit = part * ring.sample(turning, j) / (area * std::cos(alpha)) *
                            (ring.sample(momentum, j) < 0 ? -1 : 1);
        change.theta += part * ring.sample(theta_of, j);
        change.of_momentum += unit * ring.sample(determinant, j);
        change.of_theta += unit * ring.sample(spreading, j);
      }
      if (!tunnels) changes_[knot].push_back(change);
    }
  }
  if (places.first_beyond == 0 || places.first_beyond >= rings.size()) return;
  for (std::vector<Change>& changes : changes_) {
    if (changes.empty()) continue;
    // Beyond the last one rays tunnel out. There directions turn infinitely fast, within less than a wave
    // resolves.
    const double last = changes.back().from_rim;
    for (Change& change : changes)
      change.from_grazing = std::sqrt(std::max(change.from_rim * change.from_rim - last * last, 0.0));
    std::erase_if(changes, [&](const Change& change) { return change.from_grazing < std::cbrt(1 / ka); });
  }
}

Reference References::at_rim(double phi) const {
  const auto apart = [&](const RimBend& rim) {
    const double a = phi - rim.azimuth;
    return a - 2 * pi * std::rint(a / (2 * pi));
  };
  for (std::size_t j = 0; j < rim_.size(); ++j) {
    const RimBend &before = rim_[j], &after = rim_[(j + 1) % rim_.size()];
    const double a = apart(before), b = apart(after);
    if (a < 0 || b >= 0 || a - b > 1) continue;
    double share = a / (a - b);
    if (before.tunnels != after.tunnels) share = std::rint(share);
    // Behind rays that tunnel out that of the rays of this azimuth, which are closer than coarse ones.
    if ((share < 0.5 ? before : after).tunnels) {
      LineFit fit;
      for (const Change& change : changes_[knot_at(phi)] | std::views::filter(&Change::is_next_to_rim))
        fit.add(change.of_theta, change.of_momentum);
      return {(1 - share) * before.theta + share * after.theta, fit.slope().value_or(0), 0};
    }
    return {
        (1 - share) * before.theta + share * after.theta, (1 - share) * before.bend + share * after.bend, 0};
  }
  return {};
}

std::optional<Reference> References::serving(double phi, const Stretch& s) const {
  const std::vector<Change>& changes = changes_[knot_at(phi)];
  // The least that momenta grow by; 0 where they turn back, or change faster than rings resolve.
  const auto growth = [&](const Reference& reference) {
    double least = 1;
    for (const Change& change : changes) {
      if (change.theta < s.from() || change.theta > s.to()) continue;
      const double here = change.with(reference.slope(change.theta));
      const double angle = std::abs(change.theta - s.middle) + s.half;
      if (here * std::sin(change.from_rim) * angle > steepest_) return 0.0;
      least = std::min(least, std::max(here, 0.0));
    }
    return least;
  };
  const Reference bent = at_rim(phi);
  // The twist for which the momentum changes off the rim as on a sphere, by least squares.
  Reference twisted = bent;
  double above = 0, below = 0;
  for (const Change& change : changes | std::views::filter(&Change::is_next_to_rim)) {
    const double by_twist = (change.theta - bent.theta) * change.of_theta;
    above += by_twist * (change.with(bent.bend) - 1);
    below += by_twist * by_twist + cost_of_twist * cost_of_twist;
  }
  if (below > 0 && !rim_.empty()) twisted.twist = above / below;
  // The bend alone where that is enough.
  const double with_bend = growth(bent), with_twist = growth(twisted);
  const bool is_enough = with_bend > fast_enough || with_bend >= with_twist;
  if ((is_enough ? with_bend : with_twist) < slowest_momentum) return {};
  return is_enough ? bent : twisted;
}

} // namespace scatter::wavefront
