// Threads, weaves and fabrics: against 40 digits, and by the properties that they should have.
#include <scatter/compute/device.hpp>
#include <scatter/fiber/cloth_program.hpp>
#include <scatter/fiber/fabric.hpp>
#include <scatter/fiber/thread.hpp>
#include <scatter/fiber/weave.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <random>
#include <string>
#include <vector>

namespace {

using namespace scatter;
using namespace scatter::fiber;
using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;

constexpr double degree = radians_per_degree;

json truth() {
  static const json data = json::parse(std::ifstream(SCATTER_CLOTH_TRUTH));
  return data;
}

glm::dvec3 vector_of(const json& list) {
  return {list.at(0).get<double>(), list.at(1).get<double>(), list.at(2).get<double>()};
}

/// Difference over the larger of the true value and 1e-280.
double relative(double value, double right) {
  return std::abs(value - right) / std::max(std::abs(right), 1e-280);
}

ThreadParameters thread_named(const std::string& name) {
  const auto of = [](const char* fabric, std::size_t number) {
    return load_fabric(fabric).weave.threads.at(number - 1).thread;
  };
  if (name == "silk") return of("silk-crepe-de-chine", 1);
  if (name == "linen") return of("linen-plain", 1);
  if (name == "polyester") return of("polyester-satin-front", 1);
  return of("polyester-satin-front", 2);
}

TEST(Thread, AgreesWithFortyDigits) {
  double worst = 0;
  const json cases = truth().at("thread");
  ASSERT_GT(cases.size(), 200u);
  for (const json& row : cases) {
    const Thread thread(
        thread_named(row.at("thread")), parse_surface_lobe(row.at("variant").get<std::string>()));
    const glm::dvec3 a = vector_of(row.at("angles"));
    const ThreadLobes value = thread.lobes({a.x, a.y, a.z});
    for (const auto& [got, field] :
         {std::pair{value.surface, "surface"}, std::pair{value.volume, "volume"}}) {
      const double right = row.at(field).get<double>();
      if (right < 1e-250) {
        EXPECT_NEAR(got, right, 1e-250);
        continue;
      }
      EXPECT_LT(relative(got, right), 1e-12) << row;
      worst = std::max(worst, relative(got, right));
    }
  }
  std::printf("largest relative error of f_s: %.1e\n", worst);
}

TEST(Cloth, AgreesWithFortyDigits) {
  const json cases = truth().at("cloth");
  ASSERT_GT(cases.size(), 300u);
  double worst = 0, worst_many = 0, worst_device = 0;
  const compute::Device device;
  for (const char* const variant : {"printed", "energy-true"})
    for (const std::string& name : fabric_names()) {
      const Cloth cloth(load_fabric(name).weave, 64, parse_surface_lobe(variant));
      std::vector<glm::dvec3> lights, views, right;
      std::vector<Rgb> many;
      for (const json& row : cases) {
        if (row.at("fabric") != name || row.at("variant") != variant) continue;
        lights.push_back(vector_of(row.at("light")));
        views.push_back(vector_of(row.at("view")));
        right.push_back(vector_of(row.at("value")));
      }
      many.resize(lights.size());
      cloth.eval(lights, views, many);
      for (const auto& unit : exact::vector_units()) {
        std::vector<Rgb> found(lights.size());
        cloth.eval(lights, views, found, unit);
        for (std::size_t k = 0; k < lights.size(); ++k)
          for (int c = 0; c < 3; ++c)
            EXPECT_LT(relative(found[k][c], right[k][c]), 1e-12) << name << ' ' << k << ' ' << unit.name;
      }
      std::vector<Rgb> on_device(lights.size());
      ClothProgram(cloth, device).eval(lights, views, on_device);
      for (std::size_t k = 0; k < lights.size(); ++k) {
        const Rgb one = cloth.eval(lights[k], views[k]);
        for (int c = 0; c < 3; ++c) {
          EXPECT_LT(relative(one[c], right[k][c]), 1e-12)
              << name << ' ' << k << ": " << one[c] << ", true " << right[k][c];
          EXPECT_LT(relative(many[k][c], right[k][c]), 1e-12)
              << name << ' ' << k << ": " << many[k][c] << ", true " << right[k][c];
          EXPECT_LT(relative(on_device[k][c], right[k][c]), 1e-12)
              << name << ' ' << k << " by OpenCL: " << on_device[k][c] << ", true " << right[k][c];
          worst_device = std::max(worst_device, relative(on_device[k][c], right[k][c]));
          worst = std::max(worst, relative(one[c], right[k][c]));
          worst_many = std::max(worst_many, relative(many[k][c], right[k][c]));
        }
      }
    }
  std::printf(
      "largest relative error: %.1e, of many at once %.1e, by OpenCL %.1e\n", worst, worst_many,
      worst_device);
}

} // namespace
