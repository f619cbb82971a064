#include "strand_assembly.hpp"

#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <embree3/rtcore.h>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

namespace scatter::validation {
namespace {

using fiber::Rgb;

constexpr double half_width = 300, half_length = 300, patch = 40;
constexpr double long_half_length = 4000; ///< of parallel strands: as good as endless
constexpr double piece = 20;              ///< of tangled strands between bends
constexpr int block = 128;                ///< paths that share a generator and a sum
constexpr int most_bounces = 400;

struct Random {
  std::mt19937_64 generator;
  double operator()() { return static_cast<double>(generator() >> 11) * 0x1p-53; }
};

/// Runs f(block, sums of the block) over all blocks; adds up in order.
struct Sums {
  Rgb value{}, square{}, single{};
  double strands = 0;
};
template <typename Function>
Seen over_blocks(int samples, int threads, const Function& one_sample) {
  const int blocks = (samples + block - 1) / block;
  std::vector<Sums> sums(static_cast<std::size_t>(blocks));
  std::atomic<int> next{0};
  const auto work = [&] {
    for (int b = next++; b < blocks; b = next++) {
      Random random{std::mt19937_64(static_cast<std::uint64_t>(b) * 7919 + 17)};
      Sums& sum = sums[static_cast<std::size_t>(b)];
      for (int i = b * block; i < std::min(samples, (b + 1) * block); ++i) {
        Rgb value{}, single{};
        one_sample(random, value, single, sum.strands);
        for (std::size_t c = 0; c < 3; ++c) {
          sum.value[c] += value[c];
          sum.square[c] += value[c] * value[c];
          sum.single[c] += single[c];
        }
      }
    }
  };
  const auto start = std::chrono::steady_clock::now();
  const unsigned many =
      threads > 0 ? static_cast<unsigned>(threads) : std::max(1U, std::thread::hardware_concurrency());
  std::vector<std::thread> others;
  for (unsigned i = 1; i < many; ++i) others.emplace_back(work);
  work();
  for (std::thread& other : others) other.join();
  Seen seen;
  seen.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  for (const Sums& sum : sums) {
    for (std::size_t c = 0; c < 3; ++c) {
      seen.mean[c] += sum.value[c] / samples;
      seen.error[c] += sum.square[c] / samples;
      seen.single[c] += sum.single[c] / samples;
    }
    seen.strands_before += sum.strands / samples;
  }
  for (std::size_t c = 0; c < 3; ++c)
    seen.error[c] = std::sqrt(std::max(0.0, seen.error[c] - seen.mean[c] * seen.mean[c]) / samples);
  return seen;
}

fiber::Frame frame_at(const glm::dvec3& tangent) {
  return fiber::make_frame(tangent, std::abs(tangent.z) < 0.9 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0));
}

/// The strand that the camera sees through a random point of the patch; none: try again, as what lies behind
/// a gap is not the strands' business.
StrandAssembly::Hit seen_strand(const StrandAssembly& slab, const glm::dvec3& to_eye, Random& random) {
  for (int attempt = 0; attempt < 1000; ++attempt) {
    const glm::dvec3 at(
        patch * (2 * random() - 1), patch * (2 * random() - 1), slab.parameters().thickness + 1);
    const StrandAssembly::Hit hit = slab.first(at + 20.0 * to_eye, -to_eye, -1);
    if (hit.strand >= 0) return hit;
  }
  throw RunError("no strand is seen: the slab is empty");
}

} // namespace

struct StrandAssembly::Scene {
  RTCDevice device = nullptr;
  RTCScene scene = nullptr;
  std::vector<float> vertices; ///< x, y, z, radius
  std::vector<unsigned> first; ///< of each segment's vertices
  std::vector<int> strand;     ///< of each segment
  std::size_t strands = 0;

  ~Scene() {
    if (scene != nullptr) rtcReleaseScene(scene);
    if (device != nullptr) rtcReleaseDevice(device);
  }
  [[nodiscard]] glm::dvec3 point(unsigned index) const {
    return {vertices[4 * index], vertices[4 * index + 1], vertices[4 * index + 2]};
  }
  void add(const std::vector<glm::dvec3>& line) {
    for (std::size_t i = 0; i < line.size(); ++i) {
      if (i + 1 < line.size()) {
        first.push_back(static_cast<unsigned>(vertices.size() / 4));
        strand.push_back(static_cast<int>(strands));
      }
      for (const double value : {line[i].x, line[i].y, line[i].z, 1.0})
        vertices.push_back(static_cast<float>(value));
    }
    ++strands;
  }
  /// Distance along the ray, and the segment; or infinity.
  double trace(const glm::dvec3& from, const glm::dvec3& direction, double near, unsigned& segment) const {
    RTCIntersectContext context;
    rtcInitIntersectContext(&context);
    RTCRayHit ray{};
    ray.ray.org_x = static_cast<float>(from.x);
    ray.ray.org_y = static_cast<float>(from.y);
    ray.ray.org_z = static_cast<float>(from.z);
    ray.ray.dir_x = static_cast<float>(direction.x);
    ray.ray.dir_y = static_cast<float>(direction.y);
    ray.ray.dir_z = static_cast<float>(direction.z);
    ray.ray.tnear = static_cast<float>(near);
    ray.ray.tfar = std::numeric_limits<float>::infinity();
    ray.ray.mask = ~0U;
    ray.hit.geomID = RTC_INVALID_GEOMETRY_ID;
    rtcIntersect1(scene, &context, &ray);
    if (ray.hit.geomID == RTC_INVALID_GEOMETRY_ID) return std::numeric_limits<double>::infinity();
    segment = ray.hit.primID;
    return ray.ray.tfar;
  }
};

StrandAssembly::StrandAssembly(const SlabParameters& parameters)
    : parameters_(parameters), scene_(std::make_unique<Scene>()) {
  Scene& s = *scene_;
  Random random{std::mt19937_64(parameters.seed)};
  const double area = 2 * half_width * parameters.thickness;
  const auto count = static_cast<std::size_t>(parameters.volume_share * area / pi);
  std::vector<glm::dvec2> taken;
  while (taken.size() < count) {
    const glm::dvec2 at(half_width * (2 * random() - 1), 1 + (parameters.thickness - 2) * random());
    // Parallel strands do not overlap; tangled ones would have to be told apart all along.
    if (parameters.tangle_deg == 0 &&
        std::ranges::any_of(taken, [&](const glm::dvec2& other) { return glm::distance(at, other) < 2; }))
      continue;
    taken.push_back(at);
    if (parameters.tangle_deg == 0) {
      s.add({{-long_half_length, at.x, at.y}, {long_half_length, at.x, at.y}});
      continue;
    }
    // From the middle both ways, every piece in a direction of its own; the slab's faces reflect it.
    std::normal_distribution<double> bend(0, parameters.tangle_deg * radians_per_degree);
    std::vector<glm::dvec3> line{{-half_length, at.x, at.y}};
    while (line.back().x < half_length) {
      const double a = bend(random.generator), b = bend(random.generator);
      glm::dvec3 next = line.back() + piece * glm::normalize(glm::dvec3(1, std::tan(a), std::tan(b)));
      if (next.z < 1) next.z = 2 - next.z;
      if (next.z > parameters.thickness - 1) next.z = 2 * (parameters.thickness - 1) - next.z;
      line.push_back(next);
    }
    s.add(line);
  }
  s.device = rtcNewDevice("threads=1");
  if (s.device == nullptr) throw RunError("Embree has no device");
  s.scene = rtcNewScene(s.device);
  rtcSetSceneFlags(s.scene, RTC_SCENE_FLAG_ROBUST);
  RTCGeometry geometry = rtcNewGeometry(s.device, RTC_GEOMETRY_TYPE_ROUND_LINEAR_CURVE);
  void* const vertices = rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT4, 4 * sizeof(float), s.vertices.size() / 4);
  void* const first = rtcSetNewGeometryBuffer(
      geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT, sizeof(unsigned), s.first.size());
  if (vertices == nullptr || first == nullptr) throw RunError("Embree has no memory for the strands");
  std::copy(s.vertices.begin(), s.vertices.end(), static_cast<float*>(vertices));
  std::copy(s.first.begin(), s.first.end(), static_cast<unsigned*>(first));
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(s.scene, geometry);
  rtcReleaseGeometry(geometry);
  rtcCommitScene(s.scene);
}

StrandAssembly::~StrandAssembly() = default;

std::size_t StrandAssembly::strands() const {
  return scene_->strands;
}

StrandAssembly::Hit
StrandAssembly::first(const glm::dvec3& from, const glm::dvec3& direction, int skip) const {
  double near = 0;
  for (int step = 0; step < 1000; ++step) {
    unsigned segment = 0;
    const double far = scene_->trace(from, direction, near, segment);
    if (!std::isfinite(far)) return {};
    const int strand = scene_->strand[segment];
    near = far * (1 + 1e-6) + 1e-3;
    if (strand == skip) continue;
    const glm::dvec3 a = scene_->point(scene_->first[segment]), b = scene_->point(scene_->first[segment] + 1);
    const glm::dvec3 tangent = glm::normalize(b - a), at = from + far * direction;
    const double along = std::clamp(glm::dot(at - a, tangent), 0.0, glm::distance(a, b));
    return {strand, a + along * tangent, tangent};
  }
  return {};
}

std::vector<double>
StrandAssembly::inclinations(const glm::dvec3& from, const glm::dvec3& direction, int skip) const {
  std::vector<double> found;
  std::vector<int> seen{skip};
  double near = 0;
  for (int step = 0; step < 10'000; ++step) {
    unsigned segment = 0;
    const double far = scene_->trace(from, direction, near, segment);
    if (!std::isfinite(far)) break;
    near = far * (1 + 1e-6) + 1e-3;
    const int strand = scene_->strand[segment];
    if (std::ranges::find(seen, strand) != seen.end()) continue;
    seen.push_back(strand);
    const glm::dvec3 a = scene_->point(scene_->first[segment]), b = scene_->point(scene_->first[segment] + 1);
    found.push_back(std::asin(std::clamp(glm::dot(direction, glm::normalize(b - a)), -1.0, 1.0)));
  }
  return found;
}

Seen walk(
    const StrandAssembly& slab, const fiber::FiberScattering& hair, const glm::dvec3& to_light,
    const glm::dvec3& to_eye, int paths, int threads) {
  const bool parallel = slab.parameters().tangle_deg == 0;
  return over_blocks(paths, threads, [&](Random& random, Rgb& value, Rgb& single, double& strands) {
    StrandAssembly::Hit hit = seen_strand(slab, to_eye, random);
    glm::dvec3 to = to_eye;
    Rgb weight{1, 1, 1};
    for (int bounce = 0; bounce < most_bounces; ++bounce) {
      if (parallel) hit.axis.x = 0; // all sections are alike: strands have no ends
      const fiber::Frame frame = frame_at(hit.tangent);
      const fiber::Angles light = fiber::angles(frame, to_light, to);
      if (bounce == 0)
        strands += static_cast<double>(slab.inclinations(hit.axis, to_light, hit.strand).size());
      if (slab.first(hit.axis, to_light, hit.strand).strand < 0) {
        const Rgb f = hair.eval(light);
        for (std::size_t c = 0; c < 3; ++c) value[c] += weight[c] * f[c] * std::cos(light.theta_i);
        if (bounce == 0) single = value;
      }
      // Reciprocal: sampled from the eye's side.
      const double a = random(), b = random(), c = random();
      const fiber::ScatteringSample sample = hair.sample(light.theta_o, {a, b, c});
      for (std::size_t k = 0; k < 3; ++k) weight[k] *= sample.weight[k];
      const double largest = std::ranges::max(weight);
      if (largest < 0.1) { // Russian roulette
        const double survive = largest / 0.1;
        if (!(random() < survive)) return;
        for (double& w : weight) w /= survive;
      }
      const double phi = fiber::azimuth(frame, to) + sample.phi, across = std::cos(sample.theta_o);
      to = std::sin(sample.theta_o) * frame.tangent + across * std::cos(phi) * frame.normal +
           across * std::sin(phi) * frame.binormal;
      const StrandAssembly::Hit next = slab.first(hit.axis, to, hit.strand);
      if (next.strand < 0) return;
      hit = next;
      to = -to;
    }
  });
}

Seen dual(
    const StrandAssembly& slab, const fiber::DualScattering& shading, const glm::dvec3& to_light,
    const glm::dvec3& to_eye, int points, Count count, int threads) {
  return over_blocks(points, threads, [&](Random& random, Rgb& value, Rgb& single, double& strands) {
    StrandAssembly::Hit hit = seen_strand(slab, to_eye, random);
    if (slab.parameters().tangle_deg == 0) hit.axis.x = 0;
    const fiber::Angles at = fiber::angles(frame_at(hit.tangent), to_light, to_eye);
    std::vector<double> before = slab.inclinations(hit.axis, to_light, hit.strand);
    strands += static_cast<double>(before.size());
    if (count == Count::opacity) std::ranges::fill(before, at.theta_i);
    const auto parts = shading.eval(at, shading.through(before));
    value = parts.sum();
    single = parts.single;
  });
}

} // namespace scatter::validation
