// JSON, for small tables and scripts:
//   {"wavelength_m": [w], "theta_deg": [t], "phi_deg": [f], "phase_function": [w][t][f], "error_estimate":
//   [w][t],
//    "scattering_cross_section": [w], "extinction_cross_section": [w], "refractive_index": [w][2],
//    "traced_orders": [p], "order_energy": [w][p], "method": "...", "seconds": s, "provenance": {...}}
// and where asked "phase_matrix": [w][t][f][4][4], "amplitude": [w][t][f] of {"S1": [re, im], ..., "S4": [re,
// im]}, "orders": [{"p": p, "amplitude": [w][t][f]}]. Numbers are the shortest that read back exactly. The
// whole table is kept in memory until finish(), which is why it is limited to most_numbers.

#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/checks.hpp>
#include <scatter/table/formats.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>
#include <unistd.h>

#include <charconv>
#include <fstream>
#include <optional>
#include <stdexcept>

namespace scatter::table {
namespace {

constexpr double most_numbers = 2e7;
/// What a number takes in the text: 17 digits, point, exponent, comma.
constexpr double bytes_per_number = 24;

/// Writes nested arrays of numbers without building the text of a whole table first.
class Writer {
public:
  Writer(FileWriter& out, bool single) : out_(out), single_(single) {}

  void key(const char* name) {
    out_.write(first_ ? "{\n\"" : ",\n\"");
    out_.write(name);
    out_.write("\": ");
    first_ = false;
  }
  void raw(std::string_view text) { out_.write(text); }
  void value(const char* name, const nlohmann::json& json) {
    key(name);
    // Bytes that are no UTF-8 (a file name in the command line) must not spoil the table.
    raw(json.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }
  void number(double value, bool big = false) {
    char text[32];
    const auto end = big && single_ ? std::to_chars(text, text + sizeof text, static_cast<float>(value)).ptr
                                    : std::to_chars(text, text + sizeof text, value).ptr;
    out_.write({text, end});
  }
  /// [size] elements, each written by element(i).
  template <class F>
  void array(std::size_t size, const F& element) {
    out_.write("[");
    for (std::size_t i = 0; i < size; ++i) {
      if (i > 0) out_.write(",");
      element(i);
    }
    out_.write("]");
  }
  void numbers(const std::vector<double>& values) {
    array(values.size(), [&](std::size_t i) { number(values[i]); });
  }
  void complex(const char* name, std::complex<double> value) {
    out_.write(name);
    out_.write("[");
    number(value.real(), true);
    out_.write(",");
    number(value.imag(), true);
    out_.write("]");
  }
  void amplitude(const Amplitude& a) {
    complex("{\"S1\":", a.S1);
    complex(",\"S2\":", a.S2);
    complex(",\"S3\":", a.S3);
    complex(",\"S4\":", a.S4);
    out_.write("}");
  }

private:
  FileWriter& out_;
  bool single_;
  bool first_ = true;
};

void write_table(const PhaseTable& table, FileWriter& out, bool single) {
  const TableHeader& head = table.header;
  const auto& slabs = table.slabs;
  const std::size_t W = slabs.size(), T = head.theta_deg.size(), F = head.phi_deg.size(),
                    P = head.orders.size();
  Writer json(out, single);
  json.value("wavelength_m", head.wavelength_m);
  json.value("theta_deg", head.theta_deg);
  json.value("phi_deg", head.phi_deg);
  const auto grid = [&](const auto& element) { // [w][t][f]
    json.array(W, [&](std::size_t w) {
      json.array(
          T, [&](std::size_t t) { json.array(F, [&](std::size_t f) { element(slabs[w], t * F + f); }); });
    });
  };
  json.key("phase_function");
  grid([&](const Slab& slab, std::size_t i) { json.number(slab.phase_function[i], true); });
  if (head.matrix) {
    json.key("phase_matrix");
    grid([&](const Slab& slab, std::size_t i) {
      json.array(4, [&](std::size_t row) {
        json.array(4, [&](std::size_t col) { json.number(slab.phase_matrix[16 * i + 4 * row + col], true); });
      });
    });
  }
  if (head.amplitudes) {
    json.key("amplitude");
    grid([&](const Slab& slab, std::size_t i) { json.amplitude(slab.amplitude[i]); });
  }
  if (head.per_order) {
    json.key("orders");
    json.array(P, [&](std::size_t p) {
      json.raw(fmt::format("{{\"p\":{},\"amplitude\":", head.orders[p]));
      grid([&](const Slab& slab, std::size_t i) { json.amplitude(slab.order_amplitude[p * T * F + i]); });
      json.raw("}");
    });
  }
  const auto list = [&](const char* name, const auto& element) { // [w]...
    json.key(name);
    json.array(W, [&](std::size_t w) { element(slabs[w]); });
  };
  list("error_estimate", [&](const Slab& slab) { json.numbers(slab.error_estimate); });
  list("scattering_cross_section", [&](const Slab& slab) { json.number(slab.scattering_cross_section); });
  list("extinction_cross_section", [&](const Slab& slab) { json.number(slab.extinction_cross_section); });
  if (!head.index.empty()) {
    auto index = nlohmann::json::array();
    for (const auto& m : head.index) index.push_back({m.real(), m.imag()});
    json.value("refractive_index", index);
  }
  if (P > 0) {
    json.value("traced_orders", head.orders);
    list("order_energy", [&](const Slab& slab) { json.numbers(slab.order_energy); });
  }
  const Provenance& made = head.provenance;
  json.value("method", made.method);
  json.value("seconds", table.seconds);
  auto constants = nlohmann::json::array();
  for (const auto& [name, value] : made.constants) constants.push_back({{"name", name}, {"value", value}});
  json.value(
      "provenance", {{"command", made.command},
                     {"version", made.version},
                     {"device", made.device},
                     {"created", made.created},
                     {"constants", constants}});
  json.raw("\n}\n");
}

class JsonSink final : public CheckedSink {
public:
  JsonSink(const std::string& path, bool single) : single_(single) {
    if (path != "-") file_.emplace(path);
  }

private:
  void start() override { table_.header = header(); }
  void put(std::size_t, const Slab& slab) override { table_.slabs.push_back(slab); }
  void complete(double seconds) override {
    table_.seconds = seconds;
    FileWriter out(
        file_ ? file_->descriptor() : STDOUT_FILENO, file_ ? file_->name().string() : "standard output");
    write_table(table_, out, single_);
    out.flush();
    if (file_) file_->commit();
  }

  bool single_;
  std::optional<PartFile> file_;
  PhaseTable table_;
};

class JsonSource final : public Source {
public:
  explicit JsonSource(const std::filesystem::path& path) : path_(path) { load(); }
  [[nodiscard]] const TableHeader& header() const override { return table_.header; }
  [[nodiscard]] double seconds() const override { return table_.seconds; }
  [[nodiscard]] Slab read(std::size_t wavelength, const SlabPart& part) override {
    if (wavelength >= table_.slabs.size() || part.phi.value_or(0) >= table_.header.phi_deg.size())
      throw std::out_of_range("wavelength or azimuth beyond the table");
    const std::size_t columns = table_.header.phi_deg.size();
    Slab slab = table_.slabs[wavelength];
    slab.phase_function = select_column(std::move(slab.phase_function), columns, 1, part.phi);
    slab.phase_matrix = part.matrix ? select_column(std::move(slab.phase_matrix), columns, 16, part.phi)
                                    : std::vector<double>{};
    slab.amplitude = part.amplitudes ? select_column(std::move(slab.amplitude), columns, 1, part.phi)
                                     : std::vector<Amplitude>{};
    slab.order_amplitude = part.amplitudes
                               ? select_column(std::move(slab.order_amplitude), columns, 1, part.phi)
                               : std::vector<Amplitude>{};
    return slab;
  }

private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(fmt::format("{}: {}", path_.string(), why));
  }
  void load();
  static Amplitude amplitude(const nlohmann::json& json) {
    const auto complex = [&](const char* name) {
      return std::complex<double>(json.at(name).at(0).get<double>(), json.at(name).at(1).get<double>());
    };
    return {.S1 = complex("S1"), .S2 = complex("S2"), .S3 = complex("S3"), .S4 = complex("S4")};
  }

  std::filesystem::path path_;
  PhaseTable table_;
};

void JsonSource::load() try {
  std::ifstream in(path_, std::ios::binary);
  if (!in) refuse("it cannot be opened");
  const auto json = nlohmann::json::parse(in);
  TableHeader& head = table_.header;
  json.at("wavelength_m").get_to(head.wavelength_m);
  json.at("theta_deg").get_to(head.theta_deg);
  json.at("phi_deg").get_to(head.phi_deg);
  head.matrix = json.contains("phase_matrix");
  head.amplitudes = json.contains("amplitude");
  head.per_order = json.contains("orders");
  if (json.contains("traced_orders")) json.at("traced_orders").get_to(head.orders);
  if (json.contains("refractive_index"))
    for (const auto& m : json.at("refractive_index"))
      head.index.emplace_back(m.at(0).get<double>(), m.at(1).get<double>());
  json.at("method").get_to(head.provenance.method);
  json.at("seconds").get_to(table_.seconds);
  const auto& made = json.at("provenance");
  made.at("command").get_to(head.provenance.command);
  made.at("version").get_to(head.provenance.version);
  made.at("device").get_to(head.provenance.device);
  made.at("created").get_to(head.provenance.created);
  for (const auto& constant : made.at("constants"))
    head.provenance.constants.emplace_back(
        constant.at("name").get<std::string>(), constant.at("value").get<std::string>());
  check_header(head);

  for (std::size_t w = 0; w < head.wavelength_m.size(); ++w) {
    Slab slab;
    const auto append = [](std::vector<Amplitude>& to, const nlohmann::json& rows) {
      for (const auto& row : rows)
        for (const auto& a : row) to.push_back(amplitude(a));
    };
    for (const auto& row : json.at("phase_function").at(w))
      for (const auto& value : row) slab.phase_function.push_back(value.get<double>());
    if (head.matrix)
      for (const auto& row : json.at("phase_matrix").at(w))
        for (const auto& matrix : row)
          for (const auto& line : matrix)
            for (const auto& value : line) slab.phase_matrix.push_back(value.get<double>());
    if (head.amplitudes) append(slab.amplitude, json.at("amplitude").at(w));
    if (head.per_order)
      for (const auto& order : json.at("orders")) append(slab.order_amplitude, order.at("amplitude").at(w));
    json.at("error_estimate").at(w).get_to(slab.error_estimate);
    if (json.contains("order_energy")) json.at("order_energy").at(w).get_to(slab.order_energy);
    slab.scattering_cross_section = json.at("scattering_cross_section").at(w).get<double>();
    slab.extinction_cross_section = json.at("extinction_cross_section").at(w).get<double>();
    check_slab(head, w, slab);
    table_.slabs.push_back(std::move(slab));
  }
} catch (const nlohmann::json::exception& error) {
  refuse(fmt::format("it is not a table in JSON: {}", error.what()));
} catch (const std::logic_error& error) {
  // InputError of check_header and the sizes of check_slab; refuse() above names the file already.
  const std::string why = error.what();
  if (why.starts_with(path_.string())) throw;
  refuse(why);
}

} // namespace

std::unique_ptr<Sink>
make_json_sink(const std::string& path, const TableHeader& header, const FileOptions& options) {
  const std::string name = path == "-" ? "standard output" : path;
  if (options.compression != Compression::none)
    throw InputError(fmt::format("{}: JSON is not compressed; use none, or write .nc or .exr", name));
  if (const double numbers = count_numbers(header); numbers > most_numbers)
    throw InputError(fmt::format(
        "{}: {:.3g} numbers are too many for JSON, which takes {:.3g}; write .nc or .exr", name, numbers,
        most_numbers));
  auto sink = std::make_unique<JsonSink>(path, options.precision == Precision::single_precision);
  // Most numbers need fewer digits, so this may refuse a disk that is nearly full but would do.
  if (path != "-") check_free_disk(path, count_numbers(header) * bytes_per_number);
  return sink;
}

std::unique_ptr<Source> open_json(const std::filesystem::path& path) {
  return std::make_unique<JsonSource>(path);
}

} // namespace scatter::table
