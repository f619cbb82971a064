// netCDF-4 with CF-1.10 attributes. Dimensions wavelength (m), theta, phi (degrees), each with its coordinate
// variable; order, row, col, amplitude_row, amplitude_col where needed. Variables:
//   phase_function(wavelength, theta, phi)                            sr-1, S11 / (k^2 C_sca)
//   phase_matrix(wavelength, theta, phi, row, col)                    4x4, header.matrix
//   amplitude_sum_re/_im(wavelength, theta, phi, amplitude_row, amplitude_col)     2x2, sum over orders,
//   header.amplitudes amplitude_re/_im(wavelength, order, theta, phi, amplitude_row, amplitude_col)  2x2 of
//   every order, header.per_order scattering_cross_section, extinction_cross_section (wavelength)   m2
//   refractive_index_re/_im(wavelength)
//   order_energy(wavelength, order), error_estimate(wavelength, theta)
// The 2x2 matrix is [[S2, S3], [S4, S1]]; it has dimensions of its own because a dimension has one size and
// row, col are those of the 4x4 matrix. Provenance stands in global attributes; constants have the prefix
// "constant_". The variables on (theta, phi) are chunked by some rows of one wavelength, so that a wavelength
// is written in one go; Precision::single_precision and deflate concern them alone.

#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/checks.hpp>
#include <scatter/table/formats.hpp>

#include <H5public.h>
#include <fmt/format.h>
#include <netcdf.h>

#include <algorithm>
#include <cerrno>
#include <stdexcept>

namespace scatter::table {
namespace {

constexpr const char* constant_prefix = "constant_";
/// Chunks of the big arrays: large enough to be written at disk speed, far below the 4 GB that HDF5 can hold.
constexpr std::size_t chunk_bytes = 4 << 20;

/// A name that netCDF accepts: no slash, no control characters, no space at the end.
std::string attribute_name(std::string name) {
  for (char& c : name)
    if (c == '/' || static_cast<unsigned char>(c) < 0x20 || c == 0x7f) c = '_';
  while (!name.empty() && name.back() == ' ') name.pop_back();
  return constant_prefix + (name.empty() ? "unnamed" : name);
}

/// To be called before anything of netCDF. At the end of the process HDF5 would close what could not be
/// closed on a full disk, and crash. We close every file of ours ourselves. Without effect, and without harm,
/// where the program had started HDF5 before.
void leave_out_exit_handler() {
  [[maybe_unused]] static const int done = H5dont_atexit();
}

class NetcdfSink final : public CheckedSink {
public:
  NetcdfSink(const std::string& path, const FileOptions& options) : options_(options), file_(path) {
    leave_out_exit_handler();
  }
  ~NetcdfSink() override {
    if (open_ && !failed_) nc_close(nc_);
    // HDF5 1.10 cannot close a file whose disk refused a write: it keeps a dangling handle. Such a file stays
    // open, some kilobytes until the process ends; only its space on the disk is given back now, by the part.
  }

private:
  void start() override;
  void put(std::size_t wavelength, const Slab& slab) override;
  void complete(double seconds) override;

  void check(int status) const {
    if (status == NC_NOERR) return;
    failed_ = true;
    // HDF5 tells netCDF no more than "HDF error"; errno still knows what the disk said.
    const int reason = errno;
    if (reason == ENOSPC || reason == EDQUOT || reason == EFBIG || reason == EIO || reason == EROFS)
      throw RunError(disk_error(file_.name(), reason));
    if (free_disk_bytes(file_.part()) < 1e6) throw RunError(disk_error(file_.name(), ENOSPC));
    throw RunError(fmt::format("cannot write {}: {}", file_.name().string(), nc_strerror(status)));
  }
  void text(int variable, const char* name, const std::string& value) const {
    check(nc_put_att_text(nc_, variable, name, value.size(), value.c_str()));
  }
  [[nodiscard]] int dimension(const char* name, std::size_t size) const {
    int id = -1;
    check(nc_def_dim(nc_, name, size, &id));
    return id;
  }
  [[nodiscard]] int variable(
      const char* name, nc_type type, const std::vector<int>& dimensions, const char* units,
      const char* long_name) const {
    int id = -1;
    check(nc_def_var(nc_, name, type, static_cast<int>(dimensions.size()), dimensions.data(), &id));
    text(id, "units", units);
    text(id, "long_name", long_name);
    return id;
  }
  /// `leading` counts the dimensions before theta.
  [[nodiscard]] int big_variable(
      const char* name, std::size_t leading, const std::vector<int>& dimensions, const char* units,
      const char* long_name) const;
  [[nodiscard]] int coordinate(
      const char* name, const std::vector<double>& values, const char* units, const char* standard_name,
      const char* long_name, int* id) const;
  /// Rows [row, row + rows) of a big variable; the values are [rows][F][inner...].
  void put_rows(
      int id, std::vector<std::size_t> start, std::vector<std::size_t> count, const double* values) const {
    errno = 0;
    check(nc_put_vara_double(nc_, id, start.data(), count.data(), values));
  }
  void put_amplitude(
      int re, int im, std::size_t wavelength, const std::size_t* order, const Amplitude* values) const;

  FileOptions options_;
  PartFile file_;
  int nc_ = -1;
  bool open_ = false;
  mutable bool failed_ = false;
  int phase_function_ = -1, phase_matrix_ = -1, sum_re_ = -1, sum_im_ = -1, order_re_ = -1, order_im_ = -1;
  int scattering_ = -1, extinction_ = -1, energy_ = -1, error_ = -1;
};

int NetcdfSink::big_variable(
    const char* name, std::size_t leading, const std::vector<int>& dimensions, const char* units,
    const char* long_name) const {
  const bool single = options_.precision == Precision::single_precision;
  const int id = variable(name, single ? NC_FLOAT : NC_DOUBLE, dimensions, units, long_name);
  std::vector<std::size_t> chunk(dimensions.size());
  std::size_t row_bytes = single ? sizeof(float) : sizeof(double);
  for (std::size_t d = leading + 1; d < dimensions.size(); ++d) {
    check(nc_inq_dimlen(nc_, dimensions[d], &chunk[d]));
    row_bytes *= chunk[d];
  }
  std::fill_n(chunk.begin(), leading, 1);
  // Chunks of equal size, so that hardly anything of the last one is padding.
  const auto even = [](std::size_t size, std::size_t most) {
    const std::size_t pieces = (size + most - 1) / std::max<std::size_t>(most, 1);
    return (size + pieces - 1) / pieces;
  };
  const std::size_t rows = header().theta_deg.size(), columns = chunk[leading + 1];
  chunk[leading] = even(rows, std::clamp<std::size_t>(chunk_bytes / row_bytes, 1, rows));
  // A row that is itself huge is cut along phi.
  const std::size_t per_direction = row_bytes / columns;
  chunk[leading + 1] = even(columns, std::clamp<std::size_t>(chunk_bytes / per_direction, 1, columns));
  check(nc_def_var_chunking(nc_, id, NC_CHUNKED, chunk.data()));
  // Every value is written once: filling first would write twice.
  check(nc_def_var_fill(nc_, id, NC_NOFILL, nullptr));
  if (options_.compression == Compression::deflate) check(nc_def_var_deflate(nc_, id, 1, 1, 1));
  return id;
}

int NetcdfSink::coordinate(
    const char* name, const std::vector<double>& values, const char* units, const char* standard_name,
    const char* long_name, int* id) const {
  const int dim = dimension(name, values.size());
  *id = variable(name, NC_DOUBLE, {dim}, units, long_name);
  if (*standard_name) text(*id, "standard_name", standard_name);
  return dim;
}

void NetcdfSink::start() {
  errno = 0;
  check(nc_create(file_.part().c_str(), NC_NETCDF4 | NC_CLOBBER, &nc_));
  open_ = true;
  const TableHeader& head = header();
  const Provenance& made = head.provenance;
  text(NC_GLOBAL, "Conventions", "CF-1.10");
  text(NC_GLOBAL, "title", "Tabulated phase function of a drop");
  text(NC_GLOBAL, "source", "scatter " + made.version + ", method " + made.method);
  text(NC_GLOBAL, "history", made.created + ": " + made.command);
  text(NC_GLOBAL, "command", made.command);
  text(NC_GLOBAL, "scatter_version", made.version);
  text(NC_GLOBAL, "device", made.device);
  text(NC_GLOBAL, "method", made.method);
  text(NC_GLOBAL, "created", made.created);
  text(
      NC_GLOBAL, "comment",
      "theta is the scattering angle, between the directions of propagation of the sunlight and of the "
      "scattered "
      "light; phi is the azimuth about the sunlight, 0 in the half-plane that points most downward. Time "
      "factor "
      "exp(-i omega t), amplitudes and Stokes parameters of Bohren & Huffman (1983), parallel component "
      "first.");
  for (const auto& [key, value] : made.constants) text(NC_GLOBAL, attribute_name(key).c_str(), value);
  const double unknown = 0;
  check(nc_put_att_double(nc_, NC_GLOBAL, "seconds", NC_DOUBLE, 1, &unknown)); // the room; set in complete()

  int wavelength_id = -1, theta_id = -1, phi_id = -1;
  const int wavelength = coordinate(
      "wavelength", head.wavelength_m, "m", "radiation_wavelength", "wavelength in vacuum", &wavelength_id);
  const int theta =
      coordinate("theta", head.theta_deg, "degree", "scattering_angle", "scattering angle", &theta_id);
  const int phi = coordinate(
      "phi", head.phi_deg, "degree", "", "azimuth about the direction of the sunlight, 0 = most downward",
      &phi_id);

  phase_function_ = big_variable(
      "phase_function", 1, {wavelength, theta, phi}, "sr-1",
      "phase function, its integral over the sphere is 1");
  int order = -1, order_id = -1;
  if (!head.orders.empty()) {
    order = dimension("order", head.orders.size());
    order_id =
        variable("order", NC_INT, {order}, "1", "order p: 0 external reflection, p - 1 internal reflections");
  }
  if (head.matrix)
    phase_matrix_ = big_variable(
        "phase_matrix", 1, {wavelength, theta, phi, dimension("row", 4), dimension("col", 4)}, "sr-1",
        "phase matrix for Stokes vectors (I, Q, U, V) with respect to the scattering plane");
  if (head.amplitudes || head.per_order) {
    const int row = dimension("amplitude_row", 2), col = dimension("amplitude_col", 2);
    const char* layout = "rows [S2 S3], [S4 S1]; phase referred to the origin of the drop's polar curve";
    if (head.amplitudes) {
      sum_re_ = big_variable(
          "amplitude_sum_re", 1, {wavelength, theta, phi, row, col}, "1",
          "amplitude matrix, all orders, real part");
      sum_im_ = big_variable(
          "amplitude_sum_im", 1, {wavelength, theta, phi, row, col}, "1",
          "amplitude matrix, all orders, imaginary part");
      text(sum_re_, "comment", layout);
      text(sum_im_, "comment", layout);
    }
    if (head.per_order) {
      order_re_ = big_variable(
          "amplitude_re", 2, {wavelength, order, theta, phi, row, col}, "1",
          "amplitude matrix by order, real part");
      order_im_ = big_variable(
          "amplitude_im", 2, {wavelength, order, theta, phi, row, col}, "1",
          "amplitude matrix by order, imaginary part");
      text(order_re_, "comment", layout);
      text(order_im_, "comment", layout);
    }
  }
  scattering_ = variable(
      "scattering_cross_section", NC_DOUBLE, {wavelength}, "m2",
      "scattering cross section of all orders and forward diffraction");
  extinction_ =
      variable("extinction_cross_section", NC_DOUBLE, {wavelength}, "m2", "extinction cross section");
  if (!head.orders.empty())
    energy_ = variable(
        "order_energy", NC_DOUBLE, {wavelength, order}, "1",
        "share of the energy that meets the drop, by order");
  error_ = variable(
      "error_estimate", NC_DOUBLE, {wavelength, theta}, "1",
      "estimated relative error of the intensity averaged over the sun's disc");
  int index_re = -1, index_im = -1;
  if (!head.index.empty()) {
    index_re = variable("refractive_index_re", NC_DOUBLE, {wavelength}, "1", "refractive index, real part");
    index_im = variable(
        "refractive_index_im", NC_DOUBLE, {wavelength}, "1",
        "refractive index, imaginary part; positive absorbs");
  }
  check(nc_enddef(nc_));

  check(nc_put_var_double(nc_, wavelength_id, head.wavelength_m.data()));
  check(nc_put_var_double(nc_, theta_id, head.theta_deg.data()));
  check(nc_put_var_double(nc_, phi_id, head.phi_deg.data()));
  if (order_id >= 0) check(nc_put_var_int(nc_, order_id, head.orders.data()));
  if (index_re >= 0) {
    std::vector<double> re, im;
    for (const auto& m : head.index) {
      re.push_back(m.real());
      im.push_back(m.imag());
    }
    check(nc_put_var_double(nc_, index_re, re.data()));
    check(nc_put_var_double(nc_, index_im, im.data()));
  }
}

void NetcdfSink::put_amplitude(
    int re, int im, std::size_t wavelength, const std::size_t* order, const Amplitude* values) const {
  // Split into real and imaginary parts some rows at a time: a whole copy would double the memory.
  const std::size_t rows = header().theta_deg.size(), columns = header().phi_deg.size();
  const std::size_t block = std::max<std::size_t>(chunk_bytes / (4 * columns * sizeof(double)), 1);
  std::vector<double> real, imaginary;
  for (std::size_t row = 0; row < rows; row += block) {
    const std::size_t now = std::min(block, rows - row);
    real.clear();
    imaginary.clear();
    for (std::size_t i = row * columns; i < (row + now) * columns; ++i)
      for (const auto& s : {values[i].S2, values[i].S3, values[i].S4, values[i].S1}) {
        real.push_back(s.real());
        imaginary.push_back(s.imag());
      }
    std::vector<std::size_t> start{wavelength, row, 0, 0, 0}, count{1, now, columns, 2, 2};
    if (order) {
      start.insert(start.begin() + 1, *order);
      count.insert(count.begin() + 1, 1);
    }
    put_rows(re, start, count, real.data());
    put_rows(im, start, count, imaginary.data());
  }
}

void NetcdfSink::put(std::size_t w, const Slab& slab) {
  const std::size_t rows = header().theta_deg.size(), columns = header().phi_deg.size();
  const std::size_t orders = header().orders.size();
  // Some rows at a time, because netCDF converts to single precision in a copy of what it is given.
  const std::size_t block = std::max<std::size_t>(chunk_bytes / (columns * sizeof(double)), 1);
  for (std::size_t row = 0; row < rows; row += block) {
    const std::size_t now = std::min(block, rows - row);
    put_rows(phase_function_, {w, row, 0}, {1, now, columns}, slab.phase_function.data() + row * columns);
    if (header().matrix)
      put_rows(
          phase_matrix_, {w, row, 0, 0, 0}, {1, now, columns, 4, 4},
          slab.phase_matrix.data() + row * columns * 16);
  }
  if (header().amplitudes) put_amplitude(sum_re_, sum_im_, w, nullptr, slab.amplitude.data());
  if (header().per_order)
    for (std::size_t p = 0; p < orders; ++p)
      put_amplitude(order_re_, order_im_, w, &p, slab.order_amplitude.data() + p * rows * columns);
  put_rows(error_, {w, 0}, {1, rows}, slab.error_estimate.data());
  if (orders > 0) put_rows(energy_, {w, 0}, {1, orders}, slab.order_energy.data());
  put_rows(scattering_, {w}, {1}, &slab.scattering_cross_section);
  put_rows(extinction_, {w}, {1}, &slab.extinction_cross_section);
}

void NetcdfSink::complete(double seconds) {
  errno = 0;
  check(nc_put_att_double(nc_, NC_GLOBAL, "seconds", NC_DOUBLE, 1, &seconds));
  check(nc_sync(nc_));
  open_ = false;
  errno = 0;
  check(nc_close(nc_));
  file_.commit();
}

class NetcdfSource final : public Source {
public:
  explicit NetcdfSource(const std::filesystem::path& path);
  ~NetcdfSource() override {
    if (nc_ >= 0) nc_close(nc_);
  }
  [[nodiscard]] const TableHeader& header() const override { return header_; }
  [[nodiscard]] double seconds() const override { return seconds_; }
  [[nodiscard]] Slab read(std::size_t wavelength, const SlabPart& part) override;

private:
  void load_header();
  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(fmt::format("{}: {}", path_.string(), why));
  }
  void check(int status, const char* what) const {
    if (status != NC_NOERR) refuse(fmt::format("cannot read {}: {}", what, nc_strerror(status)));
  }
  [[nodiscard]] bool has(const char* name) const {
    int id = -1;
    return nc_inq_varid(nc_, name, &id) == NC_NOERR;
  }
  /// The variable's id, if its dimensions are those named.
  [[nodiscard]] int variable(const char* name, const std::vector<std::string>& dimensions) const;
  [[nodiscard]] std::vector<double> coordinate(const char* name) const;
  [[nodiscard]] std::string text(const std::string& name) const;
  [[nodiscard]] std::vector<double> values(
      const char* name, const std::vector<std::string>& dimensions, const std::vector<std::size_t>& start,
      const std::vector<std::size_t>& count) const;
  [[nodiscard]] std::vector<Amplitude> amplitudes(
      const char* re, const char* im, std::size_t wavelength, std::optional<std::size_t> order,
      std::size_t phi, std::size_t columns) const;

  std::filesystem::path path_;
  int nc_ = -1;
  TableHeader header_;
  double seconds_ = 0;
};

int NetcdfSource::variable(const char* name, const std::vector<std::string>& dimensions) const {
  int id = -1, count = 0, ids[NC_MAX_VAR_DIMS];
  check(nc_inq_varid(nc_, name, &id), name);
  check(nc_inq_varndims(nc_, id, &count), name);
  check(nc_inq_vardimid(nc_, id, ids), name);
  bool same = static_cast<std::size_t>(count) == dimensions.size();
  for (std::size_t d = 0; same && d < dimensions.size(); ++d) {
    char found[NC_MAX_NAME + 1] = {};
    check(nc_inq_dimname(nc_, ids[d], found), name);
    same = dimensions[d] == found;
  }
  if (!same) refuse(fmt::format("the dimensions of {} are not ({})", name, fmt::join(dimensions, ", ")));
  return id;
}

std::vector<double> NetcdfSource::coordinate(const char* name) const {
  const int id = variable(name, {name});
  int dim = -1;
  std::size_t size = 0;
  check(nc_inq_dimid(nc_, name, &dim), name);
  check(nc_inq_dimlen(nc_, dim, &size), name);
  std::vector<double> all(size);
  check(nc_get_var_double(nc_, id, all.data()), name);
  return all;
}

std::string NetcdfSource::text(const std::string& name) const {
  std::size_t size = 0;
  nc_type type = NC_NAT;
  if (nc_inq_att(nc_, NC_GLOBAL, name.c_str(), &type, &size) != NC_NOERR || type != NC_CHAR)
    refuse(fmt::format("it has no attribute {}; is it a table made by scatter?", name));
  std::string value(size, '\0');
  check(nc_get_att_text(nc_, NC_GLOBAL, name.c_str(), value.data()), name.c_str());
  return value;
}

std::vector<double> NetcdfSource::values(
    const char* name, const std::vector<std::string>& dimensions, const std::vector<std::size_t>& start,
    const std::vector<std::size_t>& count) const {
  const int id = variable(name, dimensions);
  std::size_t size = 1;
  for (const std::size_t n : count) size *= n;
  std::vector<double> all(size);
  check(nc_get_vara_double(nc_, id, start.data(), count.data(), all.data()), name);
  return all;
}

NetcdfSource::NetcdfSource(const std::filesystem::path& path) : path_(path) {
  leave_out_exit_handler();
  if (const int status = nc_open(path.c_str(), NC_NOWRITE, &nc_); status != NC_NOERR) {
    nc_ = -1;
    refuse(fmt::format("it is not a readable netCDF file ({})", nc_strerror(status)));
  }
  try {
    load_header();
  } catch (...) {
    nc_close(nc_);
    throw;
  }
}

void NetcdfSource::load_header() {
  if (!has("phase_function")) refuse("it has no variable phase_function; is it a table made by scatter?");
  header_.wavelength_m = coordinate("wavelength");
  header_.theta_deg = coordinate("theta");
  header_.phi_deg = coordinate("phi");
  if (has("order"))
    for (const double p : coordinate("order")) header_.orders.push_back(static_cast<int>(p));
  if (has("refractive_index_re")) {
    const std::size_t size = header_.wavelength_m.size();
    const auto re = values("refractive_index_re", {"wavelength"}, {0}, {size});
    const auto im = values("refractive_index_im", {"wavelength"}, {0}, {size});
    for (std::size_t i = 0; i < size; ++i) header_.index.emplace_back(re[i], im[i]);
  }
  header_.matrix = has("phase_matrix");
  header_.amplitudes = has("amplitude_sum_re");
  header_.per_order = has("amplitude_re");
  Provenance& made = header_.provenance;
  made.command = text("command");
  made.version = text("scatter_version");
  made.device = text("device");
  made.method = text("method");
  made.created = text("created");
  int attributes = 0;
  check(nc_inq_natts(nc_, &attributes), "the attributes");
  for (int i = 0; i < attributes; ++i) {
    char name[NC_MAX_NAME + 1] = {};
    check(nc_inq_attname(nc_, NC_GLOBAL, i, name), "the attributes");
    const std::string key = name;
    if (key.starts_with(constant_prefix))
      made.constants.emplace_back(key.substr(std::string(constant_prefix).size()), text(key));
  }
  check(nc_get_att_double(nc_, NC_GLOBAL, "seconds", &seconds_), "the attribute seconds");
  try {
    check_header(header_);
  } catch (const InputError& error) {
    refuse(error.what());
  }
}

std::vector<Amplitude> NetcdfSource::amplitudes(
    const char* re, const char* im, std::size_t wavelength, std::optional<std::size_t> order, std::size_t phi,
    std::size_t columns) const {
  std::vector<std::string> dimensions{"wavelength", "theta", "phi", "amplitude_row", "amplitude_col"};
  std::vector<std::size_t> start{wavelength, 0, phi, 0, 0}, count{1, header_.theta_deg.size(), columns, 2, 2};
  if (order) {
    dimensions.insert(dimensions.begin() + 1, "order");
    start.insert(start.begin() + 1, *order);
    count.insert(count.begin() + 1, 1);
  }
  const auto real = values(re, dimensions, start, count), imaginary = values(im, dimensions, start, count);
  std::vector<Amplitude> all(real.size() / 4);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto at = [&](std::size_t k) {
      return std::complex<double>(real[4 * i + k], imaginary[4 * i + k]);
    };
    all[i] = {.S1 = at(3), .S2 = at(0), .S3 = at(1), .S4 = at(2)};
  }
  return all;
}

Slab NetcdfSource::read(std::size_t w, const SlabPart& part) {
  const std::size_t rows = header_.theta_deg.size();
  if (w >= header_.wavelength_m.size() || part.phi.value_or(0) >= header_.phi_deg.size())
    throw std::out_of_range("wavelength or azimuth beyond the table");
  const std::size_t phi = part.phi.value_or(0), columns = part.phi ? 1 : header_.phi_deg.size();
  Slab slab;
  slab.phase_function =
      values("phase_function", {"wavelength", "theta", "phi"}, {w, 0, phi}, {1, rows, columns});
  if (header_.matrix && part.matrix)
    slab.phase_matrix = values(
        "phase_matrix", {"wavelength", "theta", "phi", "row", "col"}, {w, 0, phi, 0, 0},
        {1, rows, columns, 4, 4});
  if (header_.amplitudes && part.amplitudes)
    slab.amplitude = amplitudes("amplitude_sum_re", "amplitude_sum_im", w, std::nullopt, phi, columns);
  if (header_.per_order && part.amplitudes)
    for (std::size_t p = 0; p < header_.orders.size(); ++p) {
      const auto one = amplitudes("amplitude_re", "amplitude_im", w, p, phi, columns);
      slab.order_amplitude.insert(slab.order_amplitude.end(), one.begin(), one.end());
    }
  slab.error_estimate = values("error_estimate", {"wavelength", "theta"}, {w, 0}, {1, rows});
  if (!header_.orders.empty())
    slab.order_energy = values("order_energy", {"wavelength", "order"}, {w, 0}, {1, header_.orders.size()});
  slab.scattering_cross_section = values("scattering_cross_section", {"wavelength"}, {w}, {1})[0];
  slab.extinction_cross_section = values("extinction_cross_section", {"wavelength"}, {w}, {1})[0];
  return slab;
}

} // namespace

std::unique_ptr<Sink>
make_netcdf_sink(const std::string& path, const TableHeader& header, const FileOptions& options) {
  if (options.compression == Compression::piz || options.compression == Compression::pxr24)
    throw InputError(
        fmt::format("{}: netCDF has no piz or pxr24 compression; use none or deflate, or write .exr", path));
  // The small arrays stay double; what they add is lost in the 2 % that chunks and metadata take.
  const double bytes = count_numbers(header) * (options.precision == Precision::single_precision ? 4 : 8);
  auto sink = std::make_unique<NetcdfSink>(path, options);
  if (options.compression == Compression::none) check_free_disk(path, bytes);
  return sink;
}

std::unique_ptr<Source> open_netcdf(const std::filesystem::path& path) {
  return std::make_unique<NetcdfSource>(path);
}

} // namespace scatter::table
