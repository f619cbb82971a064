#include "example_table.hpp"
#include "temporary_folder.hpp"
#include <scatter/optics/errors.hpp>
#include <scatter/table/files.hpp>

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <netcdf.h>

#include <algorithm>
#include <fstream>
#include <limits>
#include <sstream>

namespace scatter::table {
namespace {

struct Case {
  std::string name, extension;
  FileOptions options;
  bool matrix = false, amplitudes = false, per_order = false;
  bool single = false; ///< what is big comes back rounded to float
};

void PrintTo(const Case& c, std::ostream* out) {
  *out << c.name;
}

class ReadBack : public testing::TestWithParam<Case> {};

double stored(const Case& c, double value) {
  return c.single ? static_cast<double>(static_cast<float>(value)) : value;
}

std::vector<double> stored(const Case& c, std::vector<double> values) {
  for (double& value : values) value = stored(c, value);
  return values;
}

std::vector<std::complex<double>> flat(const Case& c, const std::vector<Amplitude>& amplitudes) {
  std::vector<std::complex<double>> all;
  for (const Amplitude& a : amplitudes)
    for (const auto& s : {a.S1, a.S2, a.S3, a.S4}) all.emplace_back(stored(c, s.real()), stored(c, s.imag()));
  return all;
}

TEST_P(ReadBack, EqualsWhatWasWritten) {
  const Case& c = GetParam();
  const TemporaryFolder folder;
  const std::string path = folder.file("table" + c.extension);
  TableHeader head = example::header(3, 91, 36);
  head.matrix = c.matrix;
  head.amplitudes = c.amplitudes;
  head.per_order = c.per_order;
  example::write(*make_file_sink(path, head, c.options), head);
  EXPECT_THAT(folder.entries(), testing::ElementsAre("table" + c.extension));

  const PhaseTable read = read_table(path);
  const bool exr = c.extension == ".exr";
  EXPECT_EQ(read.header.wavelength_m, head.wavelength_m);
  EXPECT_EQ(read.header.theta_deg, head.theta_deg);
  EXPECT_EQ(read.header.phi_deg, head.phi_deg);
  EXPECT_EQ(read.header.orders, head.orders);
  EXPECT_EQ(read.header.index, head.index);
  EXPECT_EQ(read.header.matrix, head.matrix && !exr);
  EXPECT_EQ(read.header.stokes, head.matrix && exr);
  EXPECT_EQ(read.header.amplitudes, head.amplitudes);
  EXPECT_EQ(read.header.per_order, head.per_order);
  EXPECT_EQ(read.header.provenance.command, head.provenance.command);
  EXPECT_EQ(read.header.provenance.version, head.provenance.version);
  EXPECT_EQ(read.header.provenance.device, head.provenance.device);
  EXPECT_EQ(read.header.provenance.method, head.provenance.method);
  EXPECT_EQ(read.header.provenance.created, head.provenance.created);
  EXPECT_EQ(read.header.provenance.constants, head.provenance.constants);
  EXPECT_EQ(read.seconds, 12.345678901234567);
  ASSERT_EQ(read.slabs.size(), head.wavelength_m.size());
  // Rounding once more only matters for JSON, whose shortest decimal for a float is not the float as a
  // double.
  for (std::size_t w = 0; w < read.slabs.size(); ++w) {
    const Slab &found = read.slabs[w], expected = example::slab(head, w);
    EXPECT_EQ(stored(c, found.phase_function), stored(c, expected.phase_function));
    if (exr && c.matrix) {
      std::vector<double> column;
      for (std::size_t i = 0; i < expected.phase_matrix.size(); i += 16)
        for (const std::size_t row : {1u, 2u, 3u})
          column.push_back(stored(c, expected.phase_matrix[i + 4 * row]));
      EXPECT_EQ(found.stokes, column);
      EXPECT_TRUE(found.phase_matrix.empty());
    } else {
      EXPECT_EQ(stored(c, found.phase_matrix), stored(c, expected.phase_matrix));
    }
    EXPECT_EQ(flat(c, found.amplitude), flat(c, expected.amplitude));
    EXPECT_EQ(flat(c, found.order_amplitude), flat(c, expected.order_amplitude));
    EXPECT_EQ(found.order_energy, expected.order_energy);
    EXPECT_EQ(found.error_estimate, exr ? stored(c, expected.error_estimate) : expected.error_estimate);
    EXPECT_EQ(found.scattering_cross_section, expected.scattering_cross_section);
    EXPECT_EQ(found.extinction_cross_section, expected.extinction_cross_section);
  }
}

TEST_P(ReadBack, OneAzimuthIsThatColumnOfTheWhole) {
  const Case& c = GetParam();
  const TemporaryFolder folder;
  const std::string path = folder.file("table" + c.extension);
  TableHeader head = example::header(2, 40, 7);
  head.matrix = c.matrix;
  head.amplitudes = c.amplitudes;
  head.per_order = c.per_order;
  example::write(*make_file_sink(path, head, c.options), head);

  const auto source = open_table(path);
  const Slab whole = source->read(1), column = source->read(1, {.phi = 4});
  const auto amplitudes = flat(Case{}, whole.amplitude), amplitudes_column = flat(Case{}, column.amplitude);
  const auto orders = flat(Case{}, whole.order_amplitude),
             orders_column = flat(Case{}, column.order_amplitude);
  ASSERT_EQ(column.phase_function.size(), 40u);
  ASSERT_EQ(column.phase_matrix.size() * 7, whole.phase_matrix.size());
  ASSERT_EQ(column.stokes.size() * 7, whole.stokes.size());
  ASSERT_EQ(amplitudes_column.size() * 7, amplitudes.size());
  ASSERT_EQ(orders_column.size() * 7, orders.size());
  const auto compare = [](const auto& part, const auto& all, std::size_t inner) {
    for (std::size_t i = 0; i < part.size(); ++i)
      ASSERT_EQ(part[i], all[(i / inner * 7 + 4) * inner + i % inner]) << i;
  };
  compare(column.phase_function, whole.phase_function, 1);
  compare(column.phase_matrix, whole.phase_matrix, 16);
  compare(column.stokes, whole.stokes, 3);
  compare(amplitudes_column, amplitudes, 4);
  compare(orders_column, orders, 4);
  EXPECT_EQ(column.error_estimate, whole.error_estimate);

  const Slab bare = source->read(0, {.matrix = false, .amplitudes = false});
  EXPECT_TRUE(bare.phase_matrix.empty() && bare.stokes.empty() && bare.amplitude.empty());
  EXPECT_TRUE(bare.order_amplitude.empty());
  EXPECT_THROW(static_cast<void>(source->read(2)), std::out_of_range);
  EXPECT_THROW(static_cast<void>(source->read(0, {.phi = 7})), std::out_of_range);
}

constexpr auto single = Precision::single_precision;
INSTANTIATE_TEST_SUITE_P(
    Formats, ReadBack,
    testing::Values(
        Case{"netcdf", ".nc", {}}, Case{"netcdf_matrix", ".nc", {}, true},
        Case{"netcdf_amplitudes", ".nc", {}, false, true}, Case{"netcdf_orders", ".nc", {}, true, true, true},
        Case{"netcdf_orders_alone", ".nc", {}, false, false, true},
        Case{"netcdf_deflate", ".nc", {Compression::deflate}, true, true, true},
        Case{"netcdf_single", ".nc", {Compression::none, single}, true, true, true, true},
        Case{"netcdf_single_deflate", ".nc", {Compression::deflate, single}, false, false, false, true},
        Case{"exr", ".exr", {}, false, false, false, true},
        Case{"exr_stokes", ".exr", {}, true, false, false, true},
        Case{"exr_zip", ".exr", {Compression::deflate}, true, false, false, true},
        Case{"exr_piz", ".exr", {Compression::piz}, true, false, false, true}, Case{"json", ".json", {}},
        Case{"json_orders", ".json", {}, true, true, true},
        Case{"json_single", ".json", {Compression::none, single}, true, true, true, true}),
    [](const auto& test) { return test.param.name; });

TEST(Exr, Pxr24KeepsFifteenBitsOfEveryNumber) {
  const TemporaryFolder folder;
  TableHeader head = example::header(2, 91, 36);
  head.matrix = true;
  example::write(*make_file_sink(folder.file("a.exr"), head, {.compression = Compression::pxr24}), head);
  const PhaseTable read = read_table(folder.file("a.exr"));
  for (std::size_t w = 0; w < 2; ++w) {
    const Slab expected = example::slab(head, w);
    bool rounded = false;
    for (std::size_t i = 0; i < expected.phase_function.size(); ++i) {
      EXPECT_NEAR(
          read.slabs[w].phase_function[i], expected.phase_function[i],
          std::ldexp(expected.phase_function[i], -15));
      rounded |= read.slabs[w].phase_function[i] !=
                 static_cast<double>(static_cast<float>(expected.phase_function[i]));
    }
    EXPECT_TRUE(rounded) << "PXR24 did not lose anything: was it used?";
  }
}

TEST(Grids, OfAnySpacingReadBackExactly) {
  const TemporaryFolder folder;
  for (const char* extension : {".nc", ".exr", ".json"}) {
    TableHeader head = example::header(1, 1, 1);
    head.theta_deg.clear();
    for (int i = 0; i <= 800; ++i)
      head.theta_deg.push_back(130 + i / 80.0); // as parse_angles_deg makes 130:140:0.0125
    head.phi_deg = {-90, -1e-7, 0.1, 33.3333333333333336, 1e2, 2.5e+2};
    example::write(*make_file_sink(folder.file(std::string("a") + extension), head), head);
    const PhaseTable read = read_table(folder.file(std::string("a") + extension));
    EXPECT_EQ(read.header.theta_deg, head.theta_deg) << extension;
    EXPECT_EQ(read.header.phi_deg, head.phi_deg) << extension;

    head.theta_deg = {137.5};
    head.phi_deg = {0};
    head.orders.clear();
    head.index.clear();
    example::write(*make_file_sink(folder.file(std::string("b") + extension), head), head);
    const PhaseTable one = read_table(folder.file(std::string("b") + extension));
    EXPECT_EQ(one.header.theta_deg, head.theta_deg) << extension;
    EXPECT_TRUE(one.header.orders.empty() && one.header.index.empty()) << extension;
    EXPECT_EQ(one.slabs[0].phase_function.size(), 1u) << extension;
  }
}

TEST(Netcdf, HoldsTheVariablesAndDimensionsThatItsDocumentationSays) {
  const TemporaryFolder folder;
  TableHeader head = example::header(2, 9, 5);
  head.matrix = head.amplitudes = head.per_order = true;
  example::write(*make_file_sink(folder.file("a.nc"), head), head);
  int nc = -1;
  ASSERT_EQ(nc_open(folder.file("a.nc").c_str(), NC_NOWRITE, &nc), NC_NOERR);
  const auto dimensions = [&](const char* name) {
    int id = -1, count = 0, ids[NC_MAX_VAR_DIMS];
    EXPECT_EQ(nc_inq_varid(nc, name, &id), NC_NOERR) << name;
    EXPECT_EQ(nc_inq_var(nc, id, nullptr, nullptr, &count, ids, nullptr), NC_NOERR);
    std::string text;
    for (int d = 0; d < count; ++d) {
      char dimension[NC_MAX_NAME + 1];
      EXPECT_EQ(nc_inq_dimname(nc, ids[d], dimension), NC_NOERR);
      if (d > 0) text += ',';
      text += dimension;
    }
    return text;
  };
  const auto units = [&](const char* name) {
    int id = -1;
    std::size_t size = 0;
    EXPECT_EQ(nc_inq_varid(nc, name, &id), NC_NOERR) << name;
    EXPECT_EQ(nc_inq_attlen(nc, id, "units", &size), NC_NOERR) << name;
    std::string text(size, ' ');
    EXPECT_EQ(nc_get_att_text(nc, id, "units", text.data()), NC_NOERR);
    return text;
  };
  EXPECT_EQ(dimensions("phase_function"), "wavelength,theta,phi");
  EXPECT_EQ(dimensions("phase_matrix"), "wavelength,theta,phi,row,col");
  EXPECT_EQ(dimensions("amplitude_sum_re"), "wavelength,theta,phi,amplitude_row,amplitude_col");
  EXPECT_EQ(dimensions("amplitude_im"), "wavelength,order,theta,phi,amplitude_row,amplitude_col");
  EXPECT_EQ(dimensions("order_energy"), "wavelength,order");
  EXPECT_EQ(dimensions("error_estimate"), "wavelength,theta");
  EXPECT_EQ(units("wavelength"), "m");
  EXPECT_EQ(units("theta"), "degree");
  EXPECT_EQ(units("phi"), "degree");
  EXPECT_EQ(units("phase_function"), "sr-1");
  EXPECT_EQ(units("scattering_cross_section"), "m2");
  nc_close(nc);
}

TEST(Json, KeysAndShapesAreThoseOfTheDesign) {
  const TemporaryFolder folder;
  TableHeader head = example::header(1, 2, 1);
  head.matrix = head.amplitudes = head.per_order = true;
  example::write(*make_file_sink(folder.file("a.json"), head), head);
  std::ifstream in(folder.file("a.json"));
  std::stringstream text;
  text << in.rdbuf();
  for (const char* key :
       {"wavelength_m", "theta_deg", "phi_deg", "phase_function", "error_estimate",
        "scattering_cross_section", "order_energy", "method", "seconds", "phase_matrix", "amplitude",
        "orders"})
    EXPECT_THAT(text.str(), testing::HasSubstr(std::string(key).append("\": "))) << key;
  EXPECT_THAT(text.str(), testing::HasSubstr("{\"p\":5,\"amplitude\":[[[{\"S1\":["));
}

TEST(Memory, KeepsWhatAFileWouldKeep) {
  const TableHeader head = example::header(2, 9, 5);
  MemorySink sink;
  example::write(sink, head);
  ASSERT_EQ(sink.table.slabs.size(), 2u);
  EXPECT_EQ(sink.table.slabs[1].phase_function, example::slab(head, 1).phase_function);
  EXPECT_EQ(sink.table.seconds, 12.345678901234567);
}

} // namespace
} // namespace scatter::table
