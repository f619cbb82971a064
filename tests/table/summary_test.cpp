#include "example_table.hpp"
#include "temporary_folder.hpp"
#include <scatter/table/summary.hpp>

#include <gtest/gtest.h>

namespace scatter::table {
namespace {

TEST(Summary, TellsExtremesIntegralsEnergiesAndErrors) {
  const TemporaryFolder folder;
  TableHeader head = example::header(3, 721, 36);
  {
    const auto sink = make_file_sink(folder.file("a.nc"), head);
    sink->begin(head);
    for (std::size_t w = 0; w < 3; ++w) {
      Slab slab = example::slab(head, w);
      if (w == 1) slab.phase_function[100 * 36 + 7] = 1e-9;
      if (w == 2) slab.phase_function[36] = 77;
      if (w == 2) slab.error_estimate[300] = 0.5;
      sink->write(w, slab);
    }
    sink->finish(1);
  }
  const auto source = open_table(folder.file("a.nc"));
  const Summary all = summarise(*source);
  EXPECT_EQ(all.smallest.value, 1e-9);
  EXPECT_EQ(all.smallest.wavelength_m, head.wavelength_m[1]);
  EXPECT_EQ(all.smallest.theta_deg, 25);
  EXPECT_EQ(all.smallest.phi_deg, 70);
  EXPECT_EQ(all.largest.value, 77);
  EXPECT_EQ(all.largest.theta_deg, 0.25);
  ASSERT_EQ(all.integral.size(), 3u);
  EXPECT_NEAR(all.integral[0], 1, 1e-3);
  EXPECT_EQ(all.largest_error.value, 0.5);
  EXPECT_EQ(all.largest_error.theta_deg, 75);
  EXPECT_NEAR(all.median_error, 0.01, 1e-6);
  ASSERT_EQ(all.order_energy.size(), 4u);
  EXPECT_NEAR(all.order_energy[1], 0.45 + 1.0 / 3000, 1e-12);
  EXPECT_EQ(all.extinction_cross_section[1], example::slab(head, 1).extinction_cross_section);
  EXPECT_EQ(find_constant(head.provenance, "shape"), "beard-chuang");
  EXPECT_FALSE(find_constant(head.provenance, "colour").has_value());
}

TEST(Summary, ClaimsNoIntegralOfAPartOfTheSphere) {
  const TemporaryFolder folder;
  TableHeader head = example::header(2, 41, 6);
  head.theta_deg.back() = 179;
  example::write(*make_file_sink(folder.file("a.json"), head), head);
  EXPECT_TRUE(summarise(*open_table(folder.file("a.json"))).integral.empty());
}

} // namespace
} // namespace scatter::table
