#include "support.hpp"
#include <scatter/exact/debye.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/wavefront/airy_edge.hpp>

#include <cstdio>

/// The diffraction integral near caustics, against the Debye series and against itself.
namespace {

using namespace support;

/// A sphere traced as a general drop.
Tracing sphere_as_drop(double radius_m, std::vector<int> orders, int rays = 1000) {
  Tracing tracing;
  tracing.shape = drop::cosine_series(radius_m, std::vector<double>(8, 0.0));
  tracing.rays = rays;
  tracing.orders = std::move(orders);
  tracing.focal_lines = FocalLines::exact;
  return tracing;
}

Wanted integral_at(std::vector<double> theta_deg) {
  Wanted wanted;
  wanted.theta_deg = std::move(theta_deg);
  wanted.phi_deg = {0};
  wanted.amplitudes = true;
  wanted.per_order = true;
  wanted.integral = true;
  return wanted;
}

/// Root mean square of the error of S1 and of S2, each over the largest |S1| or |S2| of the order, whichever
/// is worse.
double error_over_peak(const FarField& field, const exact::DebyeOrder& truth, std::size_t at) {
  double peak = 0, first = 0, second = 0;
  const std::size_t angles = truth.S1.size();
  for (std::size_t i = 0; i < angles; ++i) {
    const Amplitude& a = field.order_amplitude[at * angles + i];
    peak = std::max({peak, std::abs(truth.S1[i]), std::abs(truth.S2[i])});
    first += std::norm(a.S1 - truth.S1[i]);
    second += std::norm(a.S2 - truth.S2[i]);
  }
  return std::sqrt(std::max(first, second) / static_cast<double>(angles)) / peak;
}

struct Bow {
  double radius_m;
  int order;
  double first_deg, last_deg, bound;
};
void PrintTo(const Bow& bow, std::ostream* to) {
  *to << bow.radius_m * 1e3 << " mm, order " << bow.order;
}

class BowByTheIntegral : public testing::TestWithParam<Bow> {};

TEST_P(BowByTheIntegral, IsDebyesTerm) {
  const auto [radius_m, order, first, last, bound] = GetParam();
  const auto theta = range(first, last, 0.05);
  const int orders[] = {order};
  const FarField field = far_field(sphere_as_drop(radius_m, {order}, 2000), red, integral_at(theta));
  const auto truth =
      exact::debye_at_degrees(2 * pi * radius_m / red.wavelength_m, red.index, orders, theta).orders.at(0);
  const double error = error_over_peak(field, truth, 0);
  std::printf("%g mm, order %d: %.2f %% of the peak\n", radius_m * 1e3, order, 100 * error);
  EXPECT_LT(error, bound);
}

// No constant is tuned.
INSTANTIATE_TEST_SUITE_P(
    Spheres, BowByTheIntegral,
    testing::Values(
        Bow{0.1e-3, 2, 133, 145, 0.001}, Bow{0.1e-3, 3, 120, 132, 0.001}, Bow{0.4e-3, 2, 133, 145, 0.001},
        Bow{0.4e-3, 3, 120, 132, 0.0005}, Bow{1e-3, 2, 133, 145, 0.001}, Bow{1e-3, 3, 120, 132, 0.0005}));

TEST(IntegralOfHighOrders, IsDebyesTermWhereTheyGraze) {
  // Orders 6 and 7 light Alexander's band; their bows leave 8 deg and less from grazing.
  const auto theta = range(120, 142, 0.1);
  const std::vector<int> orders{6, 7};
  const Tracing tracing = sphere_as_drop(0.1e-3, orders);
  const auto truth = exact::debye_at_degrees(2 * pi * 0.1e-3 / red.wavelength_m, red.index, orders, theta);
  const FarField field = far_field(tracing, red, integral_at(theta));
  const double sixth = error_over_peak(field, truth.orders[0], 0);
  const double seventh = error_over_peak(field, truth.orders[1], 1);
  std::printf("order 6: %.2f %%, order 7: %.2f %% of the peak\n", 100 * sixth, 100 * seventh);
  EXPECT_LT(sixth, 0.005);
  EXPECT_LT(seventh, 0.005);
}

TEST(DiffractionIntegral, DoesNotDependOnThreads) {
  const Tracing tracing = sphere_as_drop(0.2e-3, {2, 3}, 200);
  const auto theta = range(120, 145, 0.25);
  const compute::Device one(1), two(2);
  const auto run = [&](const compute::Device& on) {
    Tracer tracer(tracing, on);
    return far_field(tracer, red, integral_at(theta));
  };
  EXPECT_EQ(run(one).phase_function, run(two).phase_function);
}

TEST(DiffractionIntegral, DoesNotDependOnItsWindows) {
  // The same directions of a raindrop with others around them, so that bands of angles and windows have other
  // centres and tapers.
  Tracing tracing;
  tracing.shape = drop::beard_chuang(0.5e-3);
  tracing.sun_elevation_deg = 20;
  tracing.orders = {2};
  tracing.rays = 600;
  tracing.focal_lines = FocalLines::exact;
  Tracer tracer(tracing, device());
  const auto at = [&](bool by_windows, double first, double last, double phi_first, double phi_last) {
    Wanted wanted = integral_at(range(first, last, 0.1));
    wanted.sampling.by_windows = by_windows;
    wanted.phi_deg = range(phi_first, phi_last, 2);
    return far_field(tracer, red, wanted);
  };
  for (const bool by_windows : {false, true}) {
    // 136..139 deg at azimuths 62..66 deg, from the beginning and from the end of the tables.
    const FarField early = at(by_windows, 136, 143, 62, 72), late = at(by_windows, 133, 139, 56, 66);
    double peak = 0, worst = 0;
    for (int t = 0; t <= 30; ++t)
      for (int f = 0; f <= 2; ++f) {
        const Amplitude& a = early.amplitude[t * 6 + f];
        const Amplitude& b = late.amplitude[(t + 30) * 6 + f + 3];
        peak = std::max({peak, std::abs(a.S1), std::abs(a.S2)});
        worst = std::max(worst, difference(a, b));
      }
    EXPECT_GT(peak, 0);
    std::printf("other %s: %.3f %% of the peak\n", by_windows ? "windows" : "bands", 100 * worst / peak);
    EXPECT_LT(worst, 0.01 * peak);
  }
}

TEST(DiffractionIntegral, IsTheSameAlongLinesOfAzimuthAndOverWindows) {
  // Two charts of the same wavefront: at each azimuth an integral over theta's momentum alone, and one over
  // both momenta in windows of directions. They have nothing in common but rays and coefficients.
  Tracing tracing;
  tracing.shape = drop::spheroid(0.3e-3, 1 - 1e-8);
  tracing.sun_elevation_deg = 30;
  tracing.rays = 600;
  tracing.focal_lines = FocalLines::exact;
  for (const int order : {2, 3}) {
    tracing.orders = {order};
    Tracer tracer(tracing, device());
    Wanted wanted = integral_at(order == 2 ? range(134, 141, 1) : range(122, 129, 1));
    wanted.phi_deg = {0, 70, 115, 180};
    const FarField lines = far_field(tracer, red, wanted);
    wanted.sampling.by_windows = true;
    const FarField windows = far_field(tracer, red, wanted);
    double peak = 0, worst = 0;
    for (std::size_t i = 0; i < lines.amplitude.size(); ++i) {
      const Amplitude &a = lines.amplitude[i], &b = windows.amplitude[i];
      peak = std::max({peak, std::abs(b.S1), std::abs(b.S2)});
      worst = std::max(worst, difference(a, b));
    }
    std::printf("order %d: lines and windows differ by %.3f %% of the peak\n", order, 100 * worst / peak);
    EXPECT_GT(worst, 0);
    EXPECT_LT(worst, 0.002 * peak);
  }
}

TEST(DiffractionIntegral, IsNearlyTheSameAlongLinesAndOverWindowsOnARaindrop) {
  // The rim of a drop is unfolded by a number per azimuth there, by polynomials of the azimuth here.
  struct Case {
    int order;
    double theta_deg, phi_deg, bound;
  };
  for (const Case& at :
       {Case{2, 139, 60, 0.005}, Case{3, 124, 120, 0.005}, Case{3, 126, 150, 0.005}, Case{3, 126, 20, 0.015},
        Case{4, 40, 60, 0.01}, Case{5, 52, 60, 0.005}}) {
    Tracing tracing;
    tracing.shape = drop::beard_chuang(0.5e-3);
    tracing.sun_elevation_deg = 20;
    tracing.rays = 600;
    tracing.orders = {at.order};
    Tracer tracer(tracing, device());
    Wanted wanted = integral_at(range(at.theta_deg - 2, at.theta_deg + 2, 0.1));
    wanted.phi_deg = {at.phi_deg};
    const std::vector<Amplitude> lines = far_field(tracer, red, wanted).amplitude;
    wanted.sampling.by_windows = true;
    const std::vector<Amplitude> windows = far_field(tracer, red, wanted).amplitude;
    double peak = 0, worst = 0;
    for (std::size_t i = 0; i < lines.size(); ++i) {
      peak = std::max({peak, std::abs(lines[i].S1), std::abs(lines[i].S2)});
      worst = std::max(worst, difference(lines[i], windows[i]));
    }
    std::printf(
        "order %d, %g deg, azimuth %g deg: lines and windows differ by %.2f %% of the peak\n", at.order,
        at.theta_deg, at.phi_deg, 100 * worst / peak);
    EXPECT_GT(worst, 0);
    EXPECT_LT(worst, at.bound * peak);
  }
}

TEST(DiffractionIntegral, HardlyKnowsAHardlyFlattenedSphere) {
  // One part in 10^8 turns half of the rays that enter at the rim into rays that tunnel out: the field is
  // that of the sphere all the same, wherever the sun.
  const auto theta = range(124, 128, 0.5);
  const auto truth =
      exact::debye_at_degrees(2 * pi * 0.5e-3 / red.wavelength_m, red.index, std::vector<int>{3}, theta)
          .orders.at(0);
  double peak = 0;
  for (const auto& S1 : truth.S1) peak = std::max(peak, std::abs(S1));
  Tracing tracing;
  tracing.shape = drop::spheroid(0.5e-3, 1 - 1e-8);
  tracing.orders = {3};
  tracing.rays = 600;
  for (const double sun : {20.0, 35.53, 70.0}) {
    tracing.sun_elevation_deg = sun;
    Tracer tracer(tracing, device());
    Wanted wanted = integral_at(theta);
    wanted.phi_deg = {0, 90, 180};
    const FarField field = far_field(tracer, red, wanted);
    double worst = 0;
    for (std::size_t t = 0; t < theta.size(); ++t)
      for (std::size_t f = 0; f < 3; ++f) {
        const Amplitude& a = field.amplitude[t * 3 + f];
        worst = std::max({worst, std::abs(a.S1 - truth.S1[t]), std::abs(a.S2 - truth.S2[t])});
      }
    std::printf("sun %g deg: %.3f %% of the peak\n", sun, 100 * worst / peak);
    EXPECT_LT(worst, 0.001 * peak);
  }
}

/// Light that comes in along the reversed way out is light of another sun; it leaves along the reversed way
/// in. Rays that enter next to the rim there leave next to it here. By how much the amplitudes of both
/// differ, over the peak within 2 deg.
double
broken_reciprocity(double radius_m, int order, double theta_deg, double phi_deg, bool by_windows = false) {
  constexpr double degree = pi / 180;
  const double h = 20 * degree;
  Tracing tracing;
  tracing.shape = drop::beard_chuang(radius_m);
  tracing.rays = 600;
  tracing.orders = {order};
  const double theta = theta_deg * degree, phi = phi_deg * degree;
  const double down = -(std::sin(theta) * std::cos(phi) * std::cos(h) + std::cos(theta) * std::sin(h));
  const double h_back = std::asin(down),
               phi_back =
                   std::acos((-std::sin(h) - std::cos(theta) * down) / (std::sin(theta) * std::cos(h_back)));
  const auto at = [&](double sun, double azimuth) {
    tracing.sun_elevation_deg = sun / degree;
    Wanted wanted = integral_at(range(theta_deg - 2, theta_deg + 2, 0.1));
    wanted.phi_deg = {azimuth / degree};
    wanted.sampling.by_windows = by_windows;
    return far_field(tracing, red, wanted).amplitude;
  };
  const std::vector<Amplitude> there = at(h, phi), again = at(h_back, phi_back);
  double peak = 0;
  for (const Amplitude& a : there) peak = std::max({peak, std::abs(a.S1), std::abs(a.S2)});
  const Amplitude &a = there[20], &b = again[20];
  const double worst = std::max(
      {std::abs(a.S1 - b.S1), std::abs(a.S2 - b.S2), std::abs(std::abs(a.S3) - std::abs(b.S4)),
       std::abs(std::abs(a.S4) - std::abs(b.S3))});
  std::printf(
      "%g mm, order %d, %g deg, azimuth %g deg%s: %.2f %% of the peak\n", radius_m * 1e3, order, theta_deg,
      phi_deg, by_windows ? " by windows" : "", 100 * worst / peak);
  return worst / peak;
}

TEST(DiffractionIntegral, OfARaindropIsReciprocal) {
  EXPECT_LT(broken_reciprocity(0.5e-3, 2, 139, 60), 0.01);
  EXPECT_LT(broken_reciprocity(0.5e-3, 2, 141, 150), 0.01);
  EXPECT_LT(broken_reciprocity(0.5e-3, 3, 125, 90), 0.01);
  EXPECT_LT(broken_reciprocity(0.5e-3, 3, 126, 150), 0.01);
  EXPECT_LT(broken_reciprocity(0.5e-3, 3, 127, 175), 0.01);
}

TEST(DiffractionIntegral, OfAMillimetreDropIsReciprocalToSomePerCent) {
  // Momenta of order 3 fold before the rim here: the reference has to undo it.
  EXPECT_LT(broken_reciprocity(1e-3, 2, 142, 60), 0.01);
  EXPECT_LT(broken_reciprocity(1e-3, 3, 128, 100), 0.01);
  EXPECT_LT(broken_reciprocity(1e-3, 3, 126, 120), 0.01);
  // Windows on the way back.
  EXPECT_LT(broken_reciprocity(1e-3, 3, 125, 20), 0.03);
  // Next to 40 deg rays begin to tunnel out.
  EXPECT_LT(broken_reciprocity(1e-3, 3, 122, 40), 0.09);
}

TEST(DiffractionIntegral, ByWindowsIsReciprocal) {
  EXPECT_LT(broken_reciprocity(0.5e-3, 2, 139, 60, true), 0.005);
  EXPECT_LT(broken_reciprocity(0.5e-3, 3, 124, 120, true), 0.01);
  EXPECT_LT(broken_reciprocity(0.5e-3, 3, 126, 20, true), 0.015);
  EXPECT_LT(broken_reciprocity(0.5e-3, 5, 52, 60, true), 0.02);
}

TEST(DiffractionIntegral, OfHighOrdersIsReciprocalToSomePerCent) {
  EXPECT_LT(broken_reciprocity(0.5e-3, 4, 40, 60), 0.03);
  EXPECT_LT(broken_reciprocity(0.5e-3, 5, 52, 150), 0.08);
  EXPECT_LT(broken_reciprocity(0.5e-3, 6, 128, 60), 0.03);
  // By windows: at the axis azimuths turn back.
  EXPECT_LT(broken_reciprocity(0.5e-3, 6, 128, 160), 0.08);
}

TEST(DiffractionIntegral, OfSmallFlatDropsHasRoomForAllRays) {
  // Tapers as wide as the sky take rays that coarse ones do not foresee.
  Tracing tracing;
  tracing.shape = drop::spheroid(5e-6, 0.9);
  tracing.sun_elevation_deg = 20;
  tracing.rays = 300;
  tracing.orders = {3};
  Wanted wanted = integral_at(range(120, 150, 5));
  wanted.phi_deg = {0, 60};
  for (const Amplitude& a : far_field(tracing, red, wanted).amplitude)
    EXPECT_TRUE(std::isfinite(std::abs(a.S1) + std::abs(a.S2) + std::abs(a.S3) + std::abs(a.S4)));
}

TEST(DiffractionIntegral, DarkSideOfARaindropsBowIsDark) {
  // Beyond a bow its order dies out within a degree, and no ray is near: what is left there comes from rays
  // that graze, 20 deg and more away, where a drop's momenta bend.
  Tracing tracing;
  tracing.shape = drop::beard_chuang(0.5e-3);
  tracing.sun_elevation_deg = 20;
  tracing.orders = {2, 3};
  tracing.rays = 600;
  tracing.focal_lines = FocalLines::exact;
  Tracer tracer(tracing, device());
  for (const int order : {2, 3}) {
    Wanted wanted = integral_at(order == 2 ? range(134, 145, 0.1) : range(125, 135, 0.1));
    wanted.phi_deg = range(0, 180, 15);
    const FarField field = far_field(tracer, red, wanted);
    const std::size_t azimuths = wanted.phi_deg.size(), angles = wanted.theta_deg.size();
    double peak = 0, dark = 0;
    for (std::size_t t = 0; t < angles; ++t)
      for (std::size_t f = 0; f < azimuths; ++f) {
        const Amplitude& a = field.order_amplitude[(order == 2 ? 0 : angles * azimuths) + t * azimuths + f];
        const double size = std::max(std::abs(a.S1), std::abs(a.S2)), theta = wanted.theta_deg[t];
        peak = std::max(peak, size);
        if (order == 2 ? theta < 134.5 : theta > 133.5) dark = std::max(dark, size);
      }
    std::printf("order %d: at most %.2f %% of the peak on the dark side\n", order, 100 * dark / peak);
    EXPECT_LT(dark, (order == 2 ? 0.005 : 0.015) * peak);
  }
}

TEST(DiffractionIntegral, RefusesWhatItCannotDo) {
  Tracing tracing = sphere_as_drop(0.2e-3, {2}, 100);
  tracing.focal_lines = FocalLines::rule;
  EXPECT_THROW(far_field(tracing, red, integral_at({138})), InputError);
}

TEST(AiryEdge, HasTheTabulatedValues) {
  // Ai and Bi at -2, -1, 0, 1, 2: DLMF 9.2 and Abramowitz & Stegun, table 10.11.
  const double table[][3] = {
      {-2, 0.22740743, -0.41230259},
      {-1, 0.53556088, 0.10399739},
      {0, 0.35502805, 0.61492663},
      {1, 0.13529242, 1.20742359},
      {2, 0.03492413, 3.29809500}};
  for (const auto& [tau, Ai, Bi] : table) {
    const AiryEdge edge = airy_edge(tau);
    EXPECT_NEAR(std::exp(edge.log_g), 1 / (pi * (Ai * Ai + Bi * Bi)), 1e-7) << tau;
    EXPECT_NEAR(std::remainder(edge.phase - pi / 4 - std::atan2(-Bi, Ai), 2 * pi), 0, 1e-7) << tau;
  }
  // Far from the rim the ray's own phase is left, with its first correction.
  EXPECT_NEAR(
      airy_edge(-8).phase, 2.0 / 3 * std::pow(8, 1.5) - 5.0 / 72 / (2.0 / 3 * std::pow(8, 1.5)), 1e-4);
}

TEST(AiryEdge, ComesOutOfItsSeries) {
  const auto& series = airy_edge_series();
  const auto sum = [&](int which, double tau) {
    double value = 0;
    for (int n = 0; n < edge_terms; ++n)
      value += series[which * edge_terms + n] * std::cos(n * std::acos(tau / edge_reach));
    return value;
  };
  for (double tau = -7.9; tau < 8; tau += 0.1) {
    EXPECT_NEAR(sum(0, tau), airy_edge(tau).log_g, 3e-6) << tau;
    EXPECT_NEAR(sum(2, tau), airy_edge(tau).phase, 3e-6) << tau;
    const double slope = (airy_edge(tau + 1e-4).log_g - airy_edge(tau - 1e-4).log_g) / 2e-4;
    EXPECT_NEAR(sum(1, tau), slope, 3e-4) << tau;
  }
}

} // namespace
