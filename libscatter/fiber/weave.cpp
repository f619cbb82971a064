#include <scatter/fiber/legendre_rule.hpp>
#include <scatter/fiber/weave.hpp>
#include <scatter/fiber/weave_kernel.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>
#include <stdexcept>
#include <utility>

namespace scatter::fiber {
namespace {

constexpr double slack = 1e-12; // of limits that sums and conversions may miss by rounding

template <typename... Parts>
[[noreturn]] void refuse(const Parts&... parts) {
  std::ostringstream message;
  (message << ... << parts);
  throw InputError(message.str());
}

void check(const TangentCurve& curve, const std::string& where) {
  if (curve.offsets.size() < 2)
    refuse(where, "offsets_deg: ", curve.offsets.size(), " of them; a curve has two or more");
  if (curve.lengths.size() + 1 != curve.offsets.size())
    refuse(
        where, "lengths: ", curve.lengths.size(), " of them for ", curve.offsets.size(),
        " offsets; there is one between each two offsets, so ", curve.offsets.size() - 1, " would be right");
  for (const double offset : curve.offsets)
    if (!(std::abs(offset) <= pi / 2 * (1 + slack)))
      refuse(where, "offsets_deg: ", offset / radians_per_degree, " is not possible; use -90 to 90 degrees");
  double sum = 0;
  for (const double length : curve.lengths) {
    if (!(length >= 0 && std::isfinite(length)))
      refuse(where, "lengths: ", length, " is not possible; use 0 (a jump) or more");
    sum += length;
  }
  if (!(sum > 0 && std::isfinite(sum)))
    refuse(where, "lengths: their sum is ", sum, "; one at least must be above 0");
}

void check_direction(const glm::dvec3& w, const char* name) {
  if (!(std::abs(glm::dot(w, w) - 1) <= 1e-9))
    refuse("the direction of the ", name, " is not of unit length: ", w.x, ", ", w.y, ", ", w.z);
}

/// exp(-d^2 / (2 s^2)) between a product and the smaller of two cosines.
double together(double m_i, double m_r, double difference, double width) {
  const double u = std::exp(-0.5 * (difference / width) * (difference / width));
  return (1 - u) * m_i * m_r + u * std::min(m_i, m_r);
}

double cosine_between(double along, double across) {
  const double length = std::hypot(along, across);
  return length > 0 ? std::max(along / length, 0.0) : 0;
}

/// The frame of one sample of a thread's curve.
Frame tangent_frame(const Cloth::Strand& strand, const Cloth::Tangent& tangent) {
  const glm::dvec3 along(strand.cos_direction, strand.sin_direction, 0), up(0, 0, 1);
  return {
      tangent.cos_offset * along + tangent.sin_offset * up,
      tangent.cos_offset * up - tangent.sin_offset * along,
      {strand.sin_direction, -strand.cos_direction, 0}};
}

/// Calls see(strand, frame, weight) for every tangent that is seen from the view, weighed by its area, its
/// masking and its projection for that direction alone. Returns the sum of the weights.
template <typename See>
double for_each_seen(std::span<const Cloth::Strand> strands, const glm::dvec3& view, const See& see) {
  double seen = 0;
  for (std::size_t j = 0; j < strands.size(); ++j)
    for (const Cloth::Tangent& tangent : strands[j].tangents) {
      const Frame frame = tangent_frame(strands[j], tangent);
      const double up = glm::dot(view, frame.normal);
      const double weight = strands[j].coverage * tangent.share *
                            (cosine_between(up, glm::dot(view, frame.binormal)) *
                             cosine_between(up, glm::dot(view, frame.tangent)));
      if (!(weight > 0)) continue;
      seen += weight;
      see(j, frame, weight);
    }
  return seen;
}

} // namespace

std::vector<double> sample_curve(const TangentCurve& curve, int count) {
  check(curve, "");
  if (count < 1 || count > 100000) refuse("samples: ", count, " is not possible; use 1 to 100000");
  double total = 0;
  for (const double length : curve.lengths) total += length;
  std::vector<double> offsets;
  for (int k = 0; k < count; ++k) {
    double at = (k + 0.5) / count * total;
    std::size_t segment = 0, last = 0; // last: the last segment that has a length
    for (std::size_t i = 0; i < curve.lengths.size(); ++i)
      if (curve.lengths[i] > 0) last = i;
    while (segment < last && at >= curve.lengths[segment]) at -= curve.lengths[segment++];
    const double share = std::min(at / curve.lengths[segment], 1.0);
    const double first = curve.offsets[segment], second = curve.offsets[segment + 1];
    offsets.push_back(first == second ? first : first + share * (second - first));
  }
  return offsets;
}

FamilyMasking parse_family_masking(const std::string& name) {
  for (const auto masking : {FamilyMasking::none, FamilyMasking::crowns})
    if (name == family_masking_name(masking)) return masking;
  throw InputError(quote(name) + " is no masking of families: use none or crowns");
}

const char* family_masking_name(FamilyMasking masking) {
  return masking == FamilyMasking::none ? "none" : "crowns";
}

void check(const Weave& weave, const std::string& where) {
  if (weave.threads.empty()) refuse(where, "threads: none; a weave has one or more");
  if (!(weave.masking_width >= 5 * radians_per_degree * (1 - slack) &&
        weave.masking_width <= 45 * radians_per_degree * (1 + slack)))
    refuse(
        where, "masking_deg: ", weave.masking_width / radians_per_degree,
        " is not possible; use 5 to 45 degrees, usually 15 to 25");
  double sum = 0;
  for (std::size_t j = 0; j < weave.threads.size(); ++j) {
    const WeaveThread& thread = weave.threads[j];
    const std::string which = where + "thread " + std::to_string(j + 1) + ": ";
    check(thread.thread, which);
    if (!(thread.coverage >= 0 && thread.coverage <= 1 + slack))
      refuse(which, "coverage: ", thread.coverage, " is not possible; use a share of the area from 0 to 1");
    if (!(std::abs(thread.direction) <= 2 * pi * (1 + slack)))
      refuse(
          which, "direction_deg: ", thread.direction / radians_per_degree,
          " is not possible; use -360 to 360 degrees");
    check(thread.curve, which);
    sum += thread.coverage;
  }
  if (!(sum <= 1 + 1e-9))
    refuse(where, "coverage: the threads' coverages add up to ", sum, "; at most 1 is possible");
}

void check_pairs(std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::size_t values) {
  if (light.size() != view.size() || light.size() != values)
    throw std::invalid_argument("cloth: lights, views and values differ in number");
  for (std::size_t pair = 0; pair < values; ++pair)
    for (const auto& [w, name] : {std::pair{light[pair], "light"}, std::pair{view[pair], "view"}})
      if (!(std::abs(glm::dot(w, w) - 1) <= 1e-9))
        check_direction(w, (std::string(name) + " of pair " + std::to_string(pair)).c_str());
}

/// The arrays behind StrandConstants' pointers.
struct Cloth::Kernel {
  std::vector<StrandConstants> strands;
  std::vector<std::vector<double>> arrays;
  WeaveConstants weave;
};

/// The threads of one direction: areas of their tangents.
struct Cloth::Family {
  double cos_direction, sin_direction;
  std::vector<Tangent> tangents;
};

Cloth::Cloth(const Weave& weave, int samples, SurfaceLobe surface, FamilyMasking masking)
    : weave_(weave), samples_(samples), masking_(masking), kernel_(std::make_unique<Kernel>()) {
  check(weave_, "");
  double covered = 0;
  for (const WeaveThread& given : weave_.threads) {
    threads_.emplace_back(given.thread, surface);
    // Exact for the axes: the cosine of pi/2 in doubles would tilt thread 2 by an ulp.
    const double turns = given.direction / (pi / 2);
    Strand strand;
    strand.cos_direction =
        turns == std::round(turns) && std::fmod(turns, 2) != 0 ? 0 : std::cos(given.direction);
    strand.sin_direction =
        turns == std::round(turns) && std::fmod(turns, 2) == 0 ? 0 : std::sin(given.direction);
    strand.coverage = given.coverage;
    covered += given.coverage;
    const std::vector<double> offsets = sample_curve(given.curve, samples_);
    // Equal tangents, those of flat sections, are evaluated once.
    std::vector<std::pair<double, int>> counted;
    for (const double offset : offsets) {
      const auto known = std::ranges::find(counted, offset, &std::pair<double, int>::first);
      if (known != counted.end())
        ++known->second;
      else
        counted.emplace_back(offset, 1);
    }
    for (const auto& [offset, count] : counted)
      strand.tangents.push_back(
          {std::abs(offset) == pi / 2 ? 0 : std::cos(offset), std::sin(offset),
           static_cast<double>(count) / samples_});
    strands_.push_back(std::move(strand));
  }

  for (const Strand& strand : strands_) {
    const auto along = [&](const Family& family) {
      return family.cos_direction * strand.cos_direction + family.sin_direction * strand.sin_direction;
    };
    const auto known = std::ranges::find_if(
        families_, [&](const Family& family) { return std::abs(std::abs(along(family)) - 1) < slack; });
    family_of_.push_back(static_cast<std::size_t>(known - families_.begin()));
    if (known == families_.end()) families_.push_back({strand.cos_direction, strand.sin_direction, {}});
    Family& family = families_[family_of_.back()];
    const double same_way = along(family) > 0 ? 1 : -1;
    for (const Tangent& tangent : strand.tangents)
      family.tangents.push_back(
          {tangent.cos_offset, same_way * tangent.sin_offset, strand.coverage * tangent.share});
  }

  for (std::size_t j = 0; j < strands_.size(); ++j) {
    const ThreadParameters& thread = weave_.threads[j].thread;
    const Strand& strand = strands_[j];
    StrandConstants made;
    made.cos_direction = strand.cos_direction;
    made.sin_direction = strand.sin_direction;
    made.coverage = strand.coverage;
    made.contrast = (thread.eta - 1) * (thread.eta + 1);
    made.surface_height =
        (surface == SurfaceLobe::printed ? 1 : 0.125) / (thread.gamma_s * std::sqrt(2 * pi));
    made.surface_rate = 0.5 * std::numbers::log2e / (thread.gamma_s * thread.gamma_s);
    made.volume_height = (1 - thread.kd) / (thread.gamma_v * std::sqrt(2 * pi));
    made.volume_rate = 0.5 * std::numbers::log2e / (thread.gamma_v * thread.gamma_v);
    made.isotropic = thread.kd;
    for (int channel = 0; channel < 3; ++channel) made.albedo[channel] = thread.albedo[channel];
    for (const auto member : {&Tangent::cos_offset, &Tangent::sin_offset, &Tangent::share}) {
      std::vector<double>& values = kernel_->arrays.emplace_back();
      for (const Tangent& tangent : strand.tangents) values.push_back(tangent.*member);
    }
    const std::size_t last = kernel_->arrays.size();
    made.cos_offset =
        kernel_->arrays[last - 3].data(); // a vector's data stay where they are when it is moved
    made.sin_offset = kernel_->arrays[last - 2].data();
    made.share = kernel_->arrays[last - 1].data();
    made.tangents = strand.tangents.size();
    for (const Tangent& tangent : strand.tangents) {
      made.least_cos_offset = std::min(made.least_cos_offset, tangent.cos_offset);
      made.largest_sin_offset = std::max(made.largest_sin_offset, std::abs(tangent.sin_offset));
    }
    kernel_->strands.push_back(made);
  }
  kernel_->weave = {
      kernel_->strands.data(), kernel_->strands.size(), std::max(1 - covered, 0.0),
      2 * std::numbers::log2e / (weave_.masking_width * weave_.masking_width)};
}

Cloth::~Cloth() = default;
Cloth::Cloth(Cloth&&) noexcept = default;
Cloth& Cloth::operator=(Cloth&&) noexcept = default;

const WeaveConstants& Cloth::constants() const {
  return kernel_->weave;
}

Rgb Cloth::eval(const glm::dvec3& light, const glm::dvec3& view) const {
  check_direction(light, "light");
  check_direction(view, "view");
  if (!(light.z > 0 && view.z > 0)) return {0, 0, 0};
  const bool crowns = masking_ == FamilyMasking::crowns;
  const double turn = wrap_angle(std::atan2(light.y, light.x) - std::atan2(view.y, view.x));
  double projected = kernel_->weave.gap * view.z * (crowns ? past_crowns(families_.size(), view) : 1);
  Rgb sum{};
  for (std::size_t j = 0; j < strands_.size(); ++j) {
    const Strand& strand = strands_[j];
    const double to_view = crowns ? unmasked(j, view) : 1;
    const double to_both = crowns ? together(unmasked(j, light), to_view, turn, weave_.masking_width) : 1;
    for (const Tangent& tangent : strand.tangents) {
      const Frame frame = tangent_frame(strand, tangent);
      const double up_i = glm::dot(light, frame.normal), up_r = glm::dot(view, frame.normal);
      if (!(up_i > 0 && up_r > 0)) continue; // masked: M = P = 0
      const double share = strand.coverage * tangent.share;
      const double P = together(
          cosine_between(up_i, glm::dot(light, frame.tangent)),
          cosine_between(up_r, glm::dot(view, frame.tangent)),
          wrap_angle(longitudinal_angle(frame, light) - longitudinal_angle(frame, view)),
          weave_.masking_width);
      projected += share * P * to_view;
      const Angles at = thread_angles(frame, light, view);
      const double M = together(
          cosine_between(up_i, glm::dot(light, frame.binormal)),
          cosine_between(up_r, glm::dot(view, frame.binormal)), at.phi, weave_.masking_width);
      const Rgb value = threads_[j].eval(at);
      for (int c = 0; c < 3; ++c) sum[c] += share * to_both * M * P * std::cos(at.theta_i) * value[c];
    }
  }
  if (!(projected > 0)) return {0, 0, 0};
  for (double& value : sum) value /= projected;
  return sum;
}

void Cloth::eval(
    std::span<const glm::dvec3> light, std::span<const glm::dvec3> view, std::span<Rgb> value,
    const exact::VectorUnit& unit) const {
  check_pairs(light, view, value.size());
  if (masking_ != FamilyMasking::none) { // the kernels do not know it
    for (std::size_t pair = 0; pair < light.size(); ++pair) value[pair] = eval(light[pair], view[pair]);
    return;
  }
  for (std::size_t begin = 0; begin < light.size(); begin += weave_lanes) {
    const std::size_t count = std::min(weave_lanes, light.size() - begin);
    WeaveBlock block;
    for (std::size_t l = 0; l < weave_lanes; ++l) {
      const std::size_t pair = begin + std::min(l, count - 1);
      for (int axis = 0; axis < 3; ++axis) {
        block.light[axis][l] = light[pair][axis];
        block.view[axis][l] = view[pair][axis];
      }
    }
    evaluate_block(kernel_->weave, block, unit);
    for (std::size_t l = 0; l < count; ++l)
      value[begin + l] = {block.value[0][l], block.value[1][l], block.value[2][l]};
  }
}

double Cloth::past_crowns(std::size_t but, const glm::dvec3& w) const {
  double product = 1;
  for (std::size_t f = 0; f < families_.size(); ++f) {
    if (f == but) continue;
    const Family& family = families_[f];
    const double along = w.x * family.cos_direction + w.y * family.sin_direction;
    double flat = 0, facing = 0;
    for (const Tangent& tangent : family.tangents) {
      flat += tangent.share * tangent.cos_offset * w.z;
      facing += tangent.share * std::max(tangent.cos_offset * w.z - tangent.sin_offset * along, 0.0);
    }
    if (facing > flat) product *= std::max(flat, 0.0) / facing;
  }
  return product;
}

double Cloth::unmasked(std::size_t thread, const glm::dvec3& w) const {
  check_direction(w, "view");
  return past_crowns(family_of_.at(thread), w);
}

double Cloth::open(const glm::dvec3& view) const {
  check_direction(view, "view");
  if (!(view.z > 0)) return 0;
  const bool crowns = masking_ == FamilyMasking::crowns;
  const double gap = kernel_->weave.gap * view.z * (crowns ? past_crowns(families_.size(), view) : 1);
  double seen = gap;
  for (std::size_t j = 0; j < strands_.size(); ++j) {
    const double to_view = crowns ? unmasked(j, view) : 1;
    for (const Tangent& tangent : strands_[j].tangents) {
      const Frame frame = tangent_frame(strands_[j], tangent);
      seen += strands_[j].coverage * tangent.share * to_view *
              cosine_between(glm::dot(view, frame.normal), glm::dot(view, frame.tangent));
    }
  }
  return seen > 0 ? gap / seen : 0;
}

double Cloth::pdf(const glm::dvec3& light, const glm::dvec3& view) const {
  double sum = 0;
  const double seen = for_each_seen(strands_, view, [&](std::size_t j, const Frame& frame, double weight) {
    sum += weight * threads_[j].pdf(thread_angles(frame, view, light));
  });
  return seen > 0 ? sum / seen : 0;
}

ClothSample Cloth::sample(const glm::dvec3& view, const std::array<double, 4>& u) const {
  check_direction(view, "view");
  ClothSample picked;
  if (!(view.z > 0)) return picked;
  struct Choice {
    std::size_t strand;
    Frame frame;
    double until;
  };
  std::vector<Choice> choices;
  const double seen = for_each_seen(strands_, view, [&](std::size_t j, const Frame& frame, double weight) {
    choices.push_back({j, frame, (choices.empty() ? 0 : choices.back().until) + weight});
  });
  if (choices.empty()) return picked;
  const auto choice = std::ranges::find_if(choices, [&](const Choice& c) { return u[3] * seen < c.until; });
  const Choice& chosen = choice != choices.end() ? *choice : choices.back();
  const Angles of_view = thread_angles(chosen.frame, view, view);
  if (!(std::cos(of_view.theta_i) > 1e-8)) return picked; // along the thread, which is then not lit
  const ScatteringSample light = threads_[chosen.strand].sample(of_view.theta_i, {u[0], u[1], u[2]});
  const double phi = azimuth(chosen.frame, view) + light.phi, c = std::cos(light.theta_o);
  const glm::dvec3 w = std::sin(light.theta_o) * chosen.frame.tangent +
                       c * std::cos(phi) * chosen.frame.normal + c * std::sin(phi) * chosen.frame.binormal;
  picked.light = glm::normalize(w);
  picked.pdf = pdf(picked.light, view);
  if (!(picked.pdf > 0)) return picked;
  picked.weight = eval(picked.light, view);
  for (double& value : picked.weight) value /= picked.pdf;
  return picked;
}

namespace {

/// Sum over the hemisphere: inclinations by Gauss-Legendre, azimuths evenly.
template <typename Add>
void over_hemisphere(int rings, const Add& add) {
  if (rings < 2 || rings > 4096) refuse("rings: ", rings, " is not possible; use 2 to 4096");
  const auto rule = legendre_rule(static_cast<std::size_t>(std::min(rings, 1000)));
  const int azimuths = 2 * rings;
  std::vector<glm::dvec3> directions(azimuths);
  for (std::size_t ring = 0; ring < rule.x.size(); ++ring) {
    const double theta = pi / 4 * (1 + rule.x[ring]);
    for (int a = 0; a < azimuths; ++a) {
      const double phi = 2 * pi * (a + 0.5) / azimuths;
      directions[a] = {std::sin(theta) * std::cos(phi), std::sin(theta) * std::sin(phi), std::cos(theta)};
    }
    add(directions, rule.weight[ring] * pi / 4 * std::sin(theta) * 2 * pi / azimuths);
  }
}

} // namespace

Rgb Cloth::albedo(const glm::dvec3& view, int rings) const {
  Rgb sum{};
  std::vector<Rgb> values;
  over_hemisphere(rings, [&](const std::vector<glm::dvec3>& lights, double weight) {
    values.resize(lights.size());
    eval(lights, std::vector<glm::dvec3>(lights.size(), view), values);
    for (const Rgb& value : values)
      for (int c = 0; c < 3; ++c) sum[c] += weight * value[c];
  });
  return sum;
}

Rgb Cloth::reflectance(const glm::dvec3& light, int rings) const {
  check_direction(light, "light");
  if (!(light.z > 0)) return {0, 0, 0};
  Rgb sum{};
  std::vector<Rgb> values;
  over_hemisphere(rings, [&](const std::vector<glm::dvec3>& views, double weight) {
    values.resize(views.size());
    eval(std::vector<glm::dvec3>(views.size(), light), views, values);
    for (std::size_t k = 0; k < views.size(); ++k)
      for (int c = 0; c < 3; ++c) sum[c] += weight * views[k].z / light.z * values[k][c];
  });
  return sum;
}

} // namespace scatter::fiber
