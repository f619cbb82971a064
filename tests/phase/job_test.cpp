#include <scatter/exact/mie.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/phase/job.hpp>
#include <scatter/phase/methods.hpp>
#include <scatter/table/grid.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <numeric>

/// The job from request to table.
namespace {

using namespace scatter;
using namespace scatter::phase;
using std::numbers::pi;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

std::vector<double> range(double first, double last, int count) {
  std::vector<double> values;
  for (int i = 0; i < count; ++i) values.push_back(first + (last - first) * i / (count - 1));
  return values;
}

Request request_for(const drop::Shape& shape) {
  Request request;
  request.shape = shape;
  request.wavelength_m = {650e-9};
  request.index = {IndexSource::Kind::given, 1.331};
  request.theta_deg = range(130, 150, 401);
  request.phi_deg = {0, 90, 180};
  request.rays = 100;
  return request;
}
Request drop_request() {
  return request_for(drop::beard_chuang(0.5e-3));
}
Request sphere_request() {
  return request_for(drop::sphere(20e-6));
}

// ---------------------------------------------------------------------------------------------------------------
// What is refused.

struct Refusal {
  std::string name;
  std::function<void(Request&)> spoil;
  std::vector<std::string> says; ///< the option, and what would be right
};
const double nan = std::numeric_limits<double>::quiet_NaN();
const std::vector<Refusal> refusals{
    {"no_radius", [](Request& r) { r.shape.radius_m = 0; }, {"--radius", "0.5mm"}},
    {"no_theta", [](Request& r) { r.theta_deg.clear(); }, {"--theta", "empty"}},
    {"theta_beyond_180",
     [](Request& r) {
       r.theta_deg = {0, 180.5};
     },
     {"--theta", "180.5deg", "0 to 180deg"}},
    {"theta_negative", [](Request& r) { r.theta_deg = {-1}; }, {"--theta", "-1deg"}},
    {"theta_nan", [](Request& r) { r.theta_deg = {nan}; }, {"--theta", "0 to 180deg"}},
    {"theta_falls",
     [](Request& r) {
       r.theta_deg = {10, 9};
     },
     {"--theta", "increase", "9deg follows 10deg"}},
    {"theta_repeats",
     [](Request& r) {
       r.theta_deg = {10, 10};
     },
     {"--theta", "increase"}},
    {"no_phi", [](Request& r) { r.phi_deg.clear(); }, {"--phi", "empty"}},
    {"phi_beyond_360", [](Request& r) { r.phi_deg = {361}; }, {"--phi", "-360 to 360deg"}},
    {"phi_falls",
     [](Request& r) {
       r.phi_deg = {10, -10};
     },
     {"--phi", "increase"}},
    {"no_wavelength", [](Request& r) { r.wavelength_m.clear(); }, {"--wavelengths", "650nm"}},
    {"wavelength_zero", [](Request& r) { r.wavelength_m = {0}; }, {"--wavelengths", "positive"}},
    {"wavelength_infinite",
     [](Request& r) { r.wavelength_m = {std::numeric_limits<double>::infinity()}; },
     {"--wavelengths", "positive"}},
    {"wavelength_outside_the_index_data",
     [](Request& r) {
       r.index = {IndexSource::Kind::hale_querry, {}};
       r.wavelength_m = {900e-9};
     },
     {"900", "380", "700"}},
    {"sun_below_the_horizon",
     [](Request& r) { r.sun_elevation_deg = -0.1; },
     {"--sun -0.1deg", "0 to 90deg"}},
    {"sun_beyond_the_zenith", [](Request& r) { r.sun_elevation_deg = 91; }, {"--sun 91deg", "0 to 90deg"}},
    {"sun_nan", [](Request& r) { r.sun_elevation_deg = nan; }, {"--sun", "0 to 90deg"}},
    {"sun_disc_negative", [](Request& r) { r.sun_disc_deg = -0.5; }, {"--sun-disc -0.5deg", "10deg"}},
    {"sun_disc_huge", [](Request& r) { r.sun_disc_deg = 11; }, {"--sun-disc 11deg", "10deg"}},
    {"one_ray", [](Request& r) { r.rays = 1; }, {"--rays 1", "2 to 20000"}},
    {"too_many_rays", [](Request& r) { r.rays = 20001; }, {"--rays 20001", "2 to 20000"}},
    {"negative_threads", [](Request& r) { r.threads = -1; }, {"--threads -1", "0"}},
    {"no_orders", [](Request& r) { r.orders.clear(); }, {"--orders", "0..3"}},
    {"order_beyond_1000",
     [](Request& r) {
       r.orders = {0, 1001};
     },
     {"--orders", "1000"}},
    {"mie_of_a_drop",
     [](Request& r) { r.method = Method::mie; },
     {"--method mie", "beard-chuang", "--method patches"}},
    {"amplitudes_of_intensities",
     [](Request& r) {
       r.interference = false;
       r.amplitudes = true;
     },
     {"--no-interference", "--amplitudes"}},
    {"orders_of_intensities",
     [](Request& r) {
       r.interference = false;
       r.per_order = true;
     },
     {"--no-interference", "--per-order"}},
    {"bubble", [](Request& r) { r.index.value = 0.75; }, {"--index 0.75", "1.0001 to 10", "--method mie"}},
    {"no_contrast", [](Request& r) { r.index.value = 1.0; }, {"--index 1", "1.0001 to 10"}},
    {"ink",
     [](Request& r) {
       r.index.value = {1.33, 0.5};
     },
     {"--index", "k = 0.5", "0.1"}},
    {"more_than_the_memory",
     [](Request& r) {
       r.theta_deg = range(0, 180, 1'000'000);
       r.phi_deg = range(0, 359, 1'000'000);
     },
     {"GB", "--theta", "--phi"}},
    {"orders_beyond_the_memory",
     [](Request& r) {
       r.theta_deg = range(0, 180, 200'000);
       r.phi_deg = range(0, 359, 100'000);
       r.per_order = true;
     },
     {"GB", "--per-order"}}};

class Refused : public testing::TestWithParam<std::size_t> {};
TEST_P(Refused, InOneLineThatSaysWhatWouldBeRight) {
  const Refusal& refusal = refusals[GetParam()];
  Request request = drop_request();
  refusal.spoil(request);
  try {
    (void)plan(request);
    FAIL() << "the request was accepted";
  } catch (const InputError& error) {
    const std::string message = error.what();
    for (const std::string& part : refusal.says) EXPECT_THAT(message, HasSubstr(part));
    EXPECT_THAT(message, Not(HasSubstr("\n")));
  }
}
INSTANTIATE_TEST_SUITE_P(
    Requests, Refused, testing::Range<std::size_t>(0, refusals.size()),
    [](const auto& one) { return refusals[one.param].name; });

TEST(Refused, MieWithSwitchesOfThePatches) {
  for (const bool interference : {false, true}) {
    Request request = sphere_request();
    request.method = Method::mie;
    request.interference = interference;
    request.per_order = interference;
    EXPECT_THROW((void)plan(request), InputError);
  }
}

TEST(Refused, MieWithOptionsOfThePatches) {
  for (bool Request::Open::*option :
       {&Request::Open::diffraction, &Request::Open::orders, &Request::Open::rays,
        &Request::Open::focal_lines}) {
    Request request = sphere_request();
    request.open.*option = false;
    EXPECT_EQ(plan(request).method, Method::patches) << "somebody asked for what Mie does not have";
    request.method = Method::mie;
    EXPECT_THROW((void)plan(request), InputError);
  }
}

// ---------------------------------------------------------------------------------------------------------------
// What is chosen.

TEST(Planner, TakesMieForASphereAndPatchesForADrop) {
  EXPECT_EQ(plan(sphere_request()).method, Method::mie);
  EXPECT_EQ(plan(drop_request()).method, Method::patches);
  // A rain drop below 0.4 mm is a sphere by its table.
  EXPECT_EQ(plan(request_for(drop::beard_chuang(0.2e-3))).method, Method::mie);
  EXPECT_EQ(plan(request_for(drop::spheroid(0.2e-3, 1))).method, Method::mie);
  Request request = sphere_request();
  request.method = Method::patches;
  EXPECT_EQ(plan(request).method, Method::patches);
  request = sphere_request();
  request.interference = false;
  EXPECT_EQ(plan(request).method, Method::patches) << "Mie knows no rays without interference";
  request = sphere_request();
  request.per_order = true;
  EXPECT_EQ(plan(request).method, Method::patches) << "Mie knows no orders";
  request = sphere_request();
  request.index.value = 0.75;
  EXPECT_EQ(plan(request).method, Method::mie) << "a bubble";
}

TEST(Planner, SaysWhatItWillDoAndWhatMadeTheTable) {
  Request request = drop_request();
  request.command = "the tests";
  const Plan planned = plan(request);
  EXPECT_THAT(
      planned.description, AllOf(HasSubstr("patches"), HasSubstr("100 x 100 rays"), HasSubstr("0,1,2,3")));
  EXPECT_GT(planned.memory_bytes, 0);
  EXPECT_LT(planned.memory_bytes, planned.available_bytes);
  const auto& header = planned.header;
  EXPECT_EQ(header.theta_deg, request.theta_deg);
  EXPECT_EQ(header.phi_deg, request.phi_deg);
  EXPECT_EQ(header.wavelength_m, request.wavelength_m);
  EXPECT_EQ(header.orders, request.orders);
  EXPECT_EQ(header.index, std::vector<std::complex<double>>{1.331});
  EXPECT_EQ(header.provenance.command, "the tests");
  EXPECT_FALSE(header.provenance.device.empty());
  EXPECT_THAT(header.provenance.method, HasSubstr("gaussian"));
}

TEST(Planner, RastersEvenTablesHoweverCoarse) {
  // Filters need finer neighbours than the table has; an even table gets them in one sweep, a list one by
  // one.
  Request request = drop_request();
  request.sun_disc_deg = 0.5;
  request.theta_deg = range(0, 180, 181);
  EXPECT_THAT(plan(request).description, HasSubstr("raster"));
  request.theta_deg = {12, 40, 138.5};
  EXPECT_THAT(plan(request).description, HasSubstr("tree"));
}

TEST(Planner, SwitchesDispersionAndAbsorption) {
  Request request = sphere_request();
  request.wavelength_m = {450e-9, 650e-9};
  request.index = {IndexSource::Kind::iapws, {}};
  auto index = plan(request).header.index;
  EXPECT_GT(index[0].real(), index[1].real() + 0.005);
  request.dispersion = false;
  index = plan(request).header.index;
  EXPECT_EQ(index[0], index[1]);
  EXPECT_EQ(index[0], refractive_index(request.index, 589.3e-9));
  request.index = {IndexSource::Kind::given, {1.33, 1e-5}};
  EXPECT_EQ(plan(request).header.index[0].imag(), 1e-5);
  request.absorption = false;
  EXPECT_EQ(plan(request).header.index[0], std::complex<double>(1.33));
}

// ---------------------------------------------------------------------------------------------------------------
// Tables.

double integral(const table::PhaseTable& made) {
  return table::sphere_integral(made.header.theta_deg, made.header.phi_deg, made.slabs.at(0).phase_function)
      .value();
}

TEST(MieTable, IntegratesToOne) {
  Request request = sphere_request();
  request.theta_deg = range(0, 180, 120001); // the forward peak of x = 193 is 1 deg wide, the ripple 0.9
  request.phi_deg = {0};
  EXPECT_NEAR(integral(phase::compute(request)), 1, 1e-6);
  request.index.value = {1.331, 1e-4};
  EXPECT_NEAR(integral(phase::compute(request)), 1, 1e-6) << "with absorption";
}

TEST(MieTable, HoldsTheSeriesItself) {
  Request request = sphere_request();
  request.theta_deg = {0, 12.5, 90, 137.5, 180};
  request.phi_deg = {0, 45};
  request.matrix = request.amplitudes = true;
  const auto slab = phase::compute(request).slabs.at(0);
  const double x = 2 * pi * 20e-6 / 650e-9;
  const auto exact = exact::mie_at_degrees(x, 1.331, request.theta_deg);
  for (std::size_t t = 0; t < 5; ++t)
    for (std::size_t f = 0; f < 2; ++f) {
      const std::size_t at = 2 * t + f;
      EXPECT_NEAR(slab.phase_function[at] / exact.phase_function[t], 1, 1e-9);
      EXPECT_EQ(slab.phase_matrix[16 * at], slab.phase_function[at]);
      // S12 and S34 of Bohren & Huffman, eq. 4.77.
      const auto S1 = exact.S1[t], S2 = exact.S2[t];
      const double s11 = (std::norm(S1) + std::norm(S2)) / 2, scale = slab.phase_function[at] / s11;
      EXPECT_NEAR(
          slab.phase_matrix[16 * at + 1], scale * (std::norm(S2) - std::norm(S1)) / 2, 1e-9 * scale * s11);
      EXPECT_NEAR(slab.phase_matrix[16 * at + 10], scale * (S1 * std::conj(S2)).real(), 1e-9 * scale * s11);
      EXPECT_NEAR(slab.phase_matrix[16 * at + 11], scale * (S2 * std::conj(S1)).imag(), 1e-9 * scale * s11);
      EXPECT_LT(std::abs(slab.amplitude[at].S1 - S1), 1e-8 * std::abs(S1) + 1e-9);
      EXPECT_EQ(slab.amplitude[at].S3, 0.0);
    }
  EXPECT_NEAR(slab.scattering_cross_section / (exact.Qsca * pi * 4e-10), 1, 1e-12);
  EXPECT_NEAR(slab.extinction_cross_section / (exact.Qext * pi * 4e-10), 1, 1e-12);
}

TEST(MieTable, AveragesOverTheSunsDisc) {
  // Against a brute sum over the disc's area: rings of suns, each sun at its own scattering angle.
  Request request = sphere_request();
  request.theta_deg = {0, 0.1, 0.4, 30, 60, 139, 150, 179.8, 180};
  request.phi_deg = {0};
  request.sun_disc_deg = 0.53;
  const auto slab = phase::compute(request).slabs.at(0);
  const double x = 2 * pi * 20e-6 / 650e-9, radius = 0.265 * pi / 180;
  constexpr int rings = 200, suns = 200;
  for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
    const double centre = request.theta_deg[t] * pi / 180;
    std::vector<double> theta;
    for (int r = 0; r < rings; ++r)
      for (int s = 0; s < suns; ++s) {
        // Rings of equal area; half of each ring will do.
        const double away = radius * std::sqrt((r + 0.5) / rings), around = pi * (s + 0.5) / suns;
        const double cosine =
            std::cos(centre) * std::cos(away) + std::sin(centre) * std::sin(away) * std::cos(around);
        theta.push_back(std::acos(std::clamp(cosine, -1.0, 1.0)) * 180 / pi);
      }
    const auto exact = exact::mie_at_degrees(x, 1.331, theta);
    const double mean = std::accumulate(exact.phase_function.begin(), exact.phase_function.end(), 0.0) /
                        static_cast<double>(theta.size());
    // The sum's own error is some 1e-5.
    EXPECT_NEAR(slab.phase_function[t] / mean, 1, 3e-5) << request.theta_deg[t];
    EXPECT_LT(slab.error_estimate[t], 1e-6) << request.theta_deg[t];
  }
}

TEST(IntegralTable, HoldsAllOfTheLight) {
  // With its forward diffraction a drop's phase function integrates to 1, but for the orders left out, the
  // glory, and what interference does to intensities of rays.
  for (const auto& shape :
       {drop::cosine_series(0.1e-3, std::vector<double>(8, 0.0)), drop::spheroid(0.1e-3, 0.97)}) {
    Request request = request_for(shape);
    request.method = Method::patches;
    request.diffraction = Diffraction::integral;
    request.rays = 600;
    request.orders = {0, 1, 2, 3, 4, 5};
    request.sun_elevation_deg = 90;
    request.theta_deg = range(0, 180, 9001);
    request.phi_deg = {0, 90, 180, 270};
    const auto made = phase::compute(request);
    const auto whole =
        table::sphere_integral(request.theta_deg, request.phi_deg, made.slabs.at(0).phase_function);
    ASSERT_TRUE(whole.has_value());
    EXPECT_NEAR(*whole, 1, 0.02);
  }
}

TEST(PatchesTable, SharesItsNormalisationWithMie) {
  Request request = request_for(drop::sphere(0.4e-3));
  request.theta_deg = range(26, 34, 801);
  request.phi_deg = {0};
  request.rays = 2000;
  request.orders = {0, 1, 2, 3, 4, 5, 6};
  request.diffraction = Diffraction::none;
  request.method = Method::patches;
  const auto rays = phase::compute(request).slabs.at(0);
  request.method = Method::mie;
  const auto series = phase::compute(request).slabs.at(0);
  double sum_rays = 0, sum_series = 0;
  for (std::size_t t = 0; t < request.theta_deg.size(); ++t) {
    sum_rays += rays.phase_function[t];
    sum_series += series.phase_function[t];
  }
  EXPECT_NEAR(sum_rays / sum_series, 1, 0.02);
  EXPECT_NEAR(rays.scattering_cross_section / series.scattering_cross_section, 1, 0.01);
}

TEST(PatchesTable, AveragesOverTheSunsDisc) {
  // A fine table without the disc, averaged over its chords here.
  Request request = drop_request();
  request.diffraction = Diffraction::none;
  request.rays = 300;
  request.theta_deg = range(136, 144, 801);
  request.phi_deg = {0, 30};
  const auto point = phase::compute(request).slabs.at(0).phase_function;
  request.sun_disc_deg = 0.5;
  const auto disc = phase::compute(request).slabs.at(0).phase_function;
  // Off the bow's edge, where rows alone would not do.
  for (const std::size_t t : {std::size_t{300}, std::size_t{400}, std::size_t{500}})
    for (std::size_t f = 0; f < 2; ++f) {
      double sum = 0, norm = 0;
      for (int k = -25; k <= 25; ++k) {
        const double chord = std::sqrt(std::max(0.0, 1 - k * k / 625.0));
        sum += chord * point[2 * (t + k) + f];
        norm += chord;
      }
      EXPECT_NEAR(disc[2 * t + f] / (sum / norm), 1, 1e-9) << request.theta_deg[t];
    }
}

TEST(GaussianFilter, LeavesWhatIsFarFromTheBowsAlone) {
  Request request = drop_request();
  request.sun_elevation_deg = 20;
  request.theta_deg = range(20, 170, 1501);
  request.phi_deg = {0, 60, 120};
  request.rays = 200;
  request.diffraction = Diffraction::none;
  const auto sharp = phase::compute(request).slabs.at(0);
  request.diffraction = Diffraction::gaussian;
  const auto smooth = phase::compute(request).slabs.at(0);
  // 0.22 deg for 0.5 mm, doubled for the secondary: 2.2 deg is the farthest that it reaches. The bows of this
  // drop stand between 115 and 150 deg.
  int touched = 0;
  for (std::size_t t = 0; t < request.theta_deg.size(); ++t)
    for (std::size_t f = 0; f < 3; ++f) {
      const double a = sharp.phase_function[3 * t + f], b = smooth.phase_function[3 * t + f];
      if (request.theta_deg[t] < 110 || request.theta_deg[t] > 155)
        EXPECT_EQ(a, b) << "theta " << request.theta_deg[t];
      else
        touched += a != b;
    }
  EXPECT_GT(touched, 100);
  EXPECT_EQ(sharp.scattering_cross_section, smooth.scattering_cross_section);
}

TEST(GaussianFilter, MeansTheSameInCoarseTablesAndInLists) {
  Request request = drop_request();
  request.phi_deg = {20};
  request.rays = 400;
  request.interference = false;
  const auto at = [&](std::vector<double> theta) {
    request.theta_deg = std::move(theta);
    return phase::compute(request).slabs.at(0).phase_function;
  };
  const auto coarse = at(range(130, 150, 21)), fine = at(range(130, 150, 2001)),
             list = at({137, 138, 139, 141, 148});
  const int angles[] = {137, 138, 139, 141, 148};
  for (std::size_t i = 0; i < 5; ++i) {
    const double expected = fine[100 * (angles[i] - 130)];
    EXPECT_NEAR(coarse[angles[i] - 130] / expected, 1, 0.02) << angles[i];
    EXPECT_NEAR(list[i] / expected, 1, 0.02) << angles[i];
  }
}

TEST(GaussianFilter, HasTheWidthsOfTheDissertationsTable) {
  const double widths[] = {0.70, 0.45, 0.30, 0.25, 0.22, 0.20, 0.18, 0.17, 0.16, 0.15};
  for (int i = 0; i < 10; ++i) EXPECT_NEAR(gaussian_filter_width_deg((i + 1) * 1e-4), widths[i], 1e-12);
  EXPECT_NEAR(gaussian_filter_width_deg(0.45e-3), 0.235, 1e-12);
  EXPECT_GT(gaussian_filter_width_deg(0.05e-3), 0.70);
  EXPECT_LT(gaussian_filter_width_deg(2e-3), 0.15);
  EXPECT_GT(gaussian_filter_width_deg(2e-3), 0.05);
}

TEST(Switches, ChangeWhatTheySay) {
  Request request = drop_request();
  request.theta_deg = range(139, 150, 111);
  request.diffraction = Diffraction::none;
  request.rays = 300;
  const auto all = phase::compute(request).slabs.at(0).phase_function;
  request.interference = false;
  const auto intensities = phase::compute(request).slabs.at(0).phase_function;
  request.interference = true;
  request.focal_lines = FocalLines::none;
  const auto without_focal_lines = phase::compute(request).slabs.at(0).phase_function;
  const auto roughness = [](const std::vector<double>& values) {
    double jumps = 0, sum = 0;
    for (std::size_t t = 1; 3 * t < values.size(); ++t) {
      jumps += std::abs(values[3 * t] - values[3 * t - 3]);
      sum += values[3 * t];
    }
    return jumps / sum;
  };
  EXPECT_GT(roughness(all), 2 * roughness(intensities)) << "interference makes supernumeraries";
  EXPECT_NE(all, without_focal_lines);
}

TEST(Job, GivesTheSameBitsWhateverTheThreads) {
  for (const bool sphere : {true, false}) {
    Request request = sphere ? sphere_request() : drop_request();
    request.matrix = request.amplitudes = true;
    request.wavelength_m = {450e-9, 650e-9};
    request.threads = 1;
    const auto one = phase::compute(request);
    request.threads = 2;
    const auto two = phase::compute(request);
    ASSERT_EQ(one.slabs.size(), 2U);
    for (std::size_t w = 0; w < 2; ++w) {
      EXPECT_EQ(one.slabs[w].phase_function, two.slabs[w].phase_function);
      EXPECT_EQ(one.slabs[w].phase_matrix, two.slabs[w].phase_matrix);
      EXPECT_EQ(one.slabs[w].order_energy, two.slabs[w].order_energy);
    }
  }
}

TEST(Job, ReportsProgressUpToOne) {
  Request request = drop_request();
  request.wavelength_m = {450e-9, 550e-9, 650e-9};
  std::vector<double> seen;
  table::MemorySink sink;
  run(plan(request), sink, [&](double done) { seen.push_back(done); });
  ASSERT_FALSE(seen.empty());
  EXPECT_TRUE(std::is_sorted(seen.begin(), seen.end()));
  EXPECT_EQ(seen.back(), 1);
  EXPECT_EQ(sink.table.slabs.size(), 3U);
  EXPECT_GT(sink.table.seconds, 0);
}

TEST(Job, GivesAnErrorEstimateForEveryAngle) {
  for (const Request& request : {sphere_request(), drop_request()}) {
    const auto made = phase::compute(request);
    const auto& estimate = made.slabs.at(0).error_estimate;
    ASSERT_EQ(estimate.size(), request.theta_deg.size());
    for (const double error : estimate) EXPECT_TRUE(error > 0 && std::isfinite(error));
  }
}

} // namespace
