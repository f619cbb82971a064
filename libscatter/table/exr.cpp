// OpenEXR, for renderers: a multi-part file, one part per wavelength, named like its channels. theta runs
// down, phi across. Channels follow the layout for spectral images of Fichet, Pacanowski & Wilkie, "An
// OpenEXR Layout for Spectral Images", JCGT 10(3), 2021: S0.380,000000nm is the phase function [sr^-1] at 380
// nm; with the phase matrix also S1, S2, S3, its first column: what unpolarised sunlight becomes.
//
// What OpenEXR cannot hold: double precision (values are rounded to 32-bit floats), amplitudes (refused), and
// the other columns of the phase matrix (not written).
//
// The metadata are attributes of every part. Numbers that must stay double are DoubleAttributes, or text in
// lists: thetaDegrees and phiDegrees as "FIRST+STEP*COUNT" where that gives the very same numbers, else one
// by one. Some of them are known only when a wavelength or the whole table is computed, but an EXR file
// begins with its headers. They are written with room for the values, and written again in complete(); no
// attribute changes its length.

#include <scatter/optics/errors.hpp>
#include <scatter/table/atomic_file.hpp>
#include <scatter/table/checks.hpp>
#include <scatter/table/formats.hpp>

#include <ImfChannelList.h>
#include <ImfDoubleAttribute.h>
#include <ImfFloatVectorAttribute.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfInputPart.h>
#include <ImfIntAttribute.h>
#include <ImfMultiPartInputFile.h>
#include <ImfMultiPartOutputFile.h>
#include <ImfOutputPart.h>
#include <ImfPartType.h>
#include <ImfStringAttribute.h>
#include <ImfThreading.h>
#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <set>
#include <stdexcept>
#include <thread>

namespace scatter::table {
namespace {

constexpr const char* constant_prefix = "constant.";

/// "380,000000nm", as the layout asks: a comma for the decimal sign, six decimals.
std::string wavelength_name(double wavelength_m) {
  std::string name = fmt::format("{:.6f}nm", wavelength_m * 1e9);
  std::replace(name.begin(), name.end(), '.', ',');
  return name;
}

/// "S1.380,000000nm"; stokes counts from 0.
std::string channel_name(std::size_t stokes, double wavelength_m) {
  return fmt::format("S{}.{}", stokes, wavelength_name(wavelength_m));
}

/// The shortest text that reads back exactly.
std::string exact(double value) {
  return fmt::format("{}", value);
}
/// Exact too, and always as long.
std::string fixed_length(double value) {
  return fmt::format("{:24.16e}", value);
}

std::string join_exact(const std::vector<double>& values) {
  return fmt::format("{}", fmt::join(values, " "));
}

std::vector<double> evenly_spaced(double first, double step, std::size_t count) {
  std::vector<double> values(count);
  for (std::size_t i = 0; i < count; ++i) values[i] = first + static_cast<double>(i) * step;
  return values;
}

/// A grid in a few characters where it is even, else one by one.
std::string grid_text(const std::vector<double>& values) {
  if (values.size() > 2) {
    const double step = (values.back() - values.front()) / static_cast<double>(values.size() - 1);
    for (const double candidate : {step, std::stod(fmt::format("{:.12g}", step))})
      if (evenly_spaced(values.front(), candidate, values.size()) == values)
        return fmt::format("{}+{}*{}", exact(values.front()), exact(candidate), values.size());
  }
  return join_exact(values);
}

std::vector<double> parse_numbers(std::string_view text) {
  std::vector<double> values;
  const char *at = text.data(), *end = text.data() + text.size();
  while (true) {
    while (at < end && *at == ' ') ++at;
    if (at == end) return values;
    double value = 0;
    const auto [next, error] = std::from_chars(at, end, value);
    if (error != std::errc()) throw InputError(fmt::format("'{}' is not a number", std::string(at, end)));
    values.push_back(value);
    at = next;
  }
}

std::vector<double> parse_grid(const std::string& text) {
  const auto star = text.find('*');
  if (star == std::string::npos) return parse_numbers(text);
  // The sign between FIRST and STEP is the last plus that no exponent owns.
  std::size_t plus = text.rfind('+', star);
  if (plus != std::string::npos && plus > 0 && text[plus - 1] == 'e') plus = text.rfind('+', plus - 1);
  if (plus == std::string::npos) throw InputError(fmt::format("'{}' is not FIRST+STEP*COUNT", text));
  const auto first = parse_numbers(std::string_view(text).substr(0, plus));
  const auto step = parse_numbers(std::string_view(text).substr(plus + 1, star - plus - 1));
  const auto count = parse_numbers(std::string_view(text).substr(star + 1));
  if (first.size() != 1 || step.size() != 1 || count.size() != 1 || !(count[0] >= 1 && count[0] <= 1e8))
    throw InputError(fmt::format("'{}' is not FIRST+STEP*COUNT", text));
  return evenly_spaced(first[0], step[0], static_cast<std::size_t>(count[0]));
}

/// OpenEXR's stream over a FileWriter, or counting bytes into memory.
class FileStream final : public Imf::OStream {
public:
  FileStream(int descriptor, const std::string& name) : Imf::OStream(name.c_str()), out_(descriptor, name) {}
  void write(const char bytes[], int count) override { out_.write({bytes, static_cast<std::size_t>(count)}); }
  std::uint64_t tellp() override { return out_.position(); }
  void seekp(std::uint64_t position) override { out_.seek(position); }
  FileWriter& out() { return out_; }

private:
  FileWriter out_;
};

class MemoryStream final : public Imf::OStream {
public:
  MemoryStream() : Imf::OStream("memory") {}
  void write(const char bytes[], int count) override {
    const auto size = static_cast<std::size_t>(count);
    if (bytes_.size() < at_ + size) bytes_.resize(at_ + size);
    std::copy(bytes, bytes + size, bytes_.begin() + static_cast<std::ptrdiff_t>(at_));
    at_ += size;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t position) override { at_ = position; }
  [[nodiscard]] const std::string& bytes() const { return bytes_; }

private:
  std::string bytes_;
  std::size_t at_ = 0;
};

Imf::Compression exr_compression(Compression compression) {
  switch (compression) {
  case Compression::none:
    return Imf::NO_COMPRESSION;
  case Compression::deflate:
    return Imf::ZIP_COMPRESSION;
  case Compression::piz:
    return Imf::PIZ_COMPRESSION;
  case Compression::pxr24:
    return Imf::PXR24_COMPRESSION;
  }
  throw std::logic_error("unreachable compression");
}

/// Rows that OpenEXR packs into one chunk.
int chunk_rows(Compression compression) {
  return compression == Compression::none ? 1 : compression == Compression::piz ? 32 : 16;
}

class ExrSink final : public CheckedSink {
public:
  ExrSink(const std::string& path, const FileOptions& options) : options_(options), file_(path) {}
  ~ExrSink() override { close(); }

private:
  void start() override;
  void put(std::size_t wavelength, const Slab& slab) override;
  void complete(double seconds) override;

  void set_text(const std::string& name, const std::string& value) {
    for (Imf::Header& part : parts_) part.insert(name, Imf::StringAttribute(value));
  }
  /// The bytes of all headers, from the file's first byte to the tables of chunk offsets.
  [[nodiscard]] std::string header_bytes() const {
    const auto per_chunk = static_cast<std::size_t>(chunk_rows(options_.compression));
    const std::size_t chunks = parts_.size() * ((header().theta_deg.size() + per_chunk - 1) / per_chunk);
    MemoryStream memory;
    const Imf::MultiPartOutputFile file(memory, parts_.data(), static_cast<int>(parts_.size()));
    return memory.bytes().substr(0, memory.bytes().size() - chunks * sizeof(std::uint64_t));
  }
  void close() noexcept {
    // OpenEXR writes the chunk offsets in the destructor and keeps quiet when that fails; the stream
    // remembers.
    output_.reset();
  }
  [[nodiscard]] std::size_t channels() const { return header().matrix ? 4 : 1; }

  FileOptions options_;
  PartFile file_;
  std::vector<Imf::Header> parts_;
  std::size_t header_size_ = 0;
  std::optional<FileStream> stream_;
  std::unique_ptr<Imf::MultiPartOutputFile> output_;
};

void ExrSink::start() try {
  const TableHeader& head = header();
  const int rows = static_cast<int>(head.theta_deg.size()), columns = static_cast<int>(head.phi_deg.size());
  const Provenance& made = head.provenance;
  for (std::size_t w = 0; w < head.wavelength_m.size(); ++w) {
    Imf::Header part(columns, rows);
    const std::string name = wavelength_name(head.wavelength_m[w]);
    part.setName(name);
    part.setType(Imf::SCANLINEIMAGE);
    part.compression() = exr_compression(options_.compression);
    for (std::size_t s = 0; s < channels(); ++s)
      part.channels().insert(channel_name(s, head.wavelength_m[w]), Imf::Channel(Imf::FLOAT));
    part.insert("wavelength", Imf::DoubleAttribute(head.wavelength_m[w]));
    if (!head.index.empty()) {
      part.insert("refractiveIndexRe", Imf::DoubleAttribute(head.index[w].real()));
      part.insert("refractiveIndexIm", Imf::DoubleAttribute(head.index[w].imag()));
    }
    part.insert("scatteringCrossSection", Imf::DoubleAttribute(0));
    part.insert("extinctionCrossSection", Imf::DoubleAttribute(0));
    part.insert("errorEstimate", Imf::FloatVectorAttribute(std::vector<float>(head.theta_deg.size(), 0.0f)));
    part.insert("seconds", Imf::DoubleAttribute(0));
    parts_.push_back(part);
  }
  set_text("spectralLayoutVersion", "1.0");
  set_text("emissiveUnits", "sr^-1");
  set_text("thetaDegrees", grid_text(head.theta_deg));
  set_text("phiDegrees", grid_text(head.phi_deg));
  set_text(
      "comments", "Phase function of a drop (integral over the sphere 1). theta, the scattering angle, runs "
                  "down; phi, the "
                  "azimuth about the sunlight (0 = most downward), runs across. S1, S2, S3: Stokes "
                  "parameters of Bohren & "
                  "Huffman (1983) with respect to the scattering plane, for unpolarised incident light.");
  set_text("command", made.command);
  set_text("scatterVersion", made.version);
  set_text("device", made.device);
  set_text("method", made.method);
  set_text("created", made.created);
  for (const auto& [key, value] : made.constants) set_text(constant_prefix + key, value);
  if (!head.orders.empty()) {
    set_text("orders", fmt::format("{}", fmt::join(head.orders, " ")));
    std::string room;
    for (std::size_t p = 0; p < head.orders.size(); ++p) room += fixed_length(0);
    set_text("orderEnergy", room);
  }
  // ZIP alone would take longer than the computation; the bytes do not depend on the number of threads.
  if (options_.compression != Compression::none && Imf::globalThreadCount() == 0)
    Imf::setGlobalThreadCount(static_cast<int>(std::thread::hardware_concurrency()));
  header_size_ = header_bytes().size();
  stream_.emplace(file_.descriptor(), file_.name().string());
  output_ =
      std::make_unique<Imf::MultiPartOutputFile>(*stream_, parts_.data(), static_cast<int>(parts_.size()));
} catch (const RunError&) {
  throw;
} catch (const std::exception& error) {
  throw RunError(fmt::format("cannot write {}: {}", file_.name().string(), error.what()));
}

void ExrSink::put(std::size_t w, const Slab& slab) try {
  const std::size_t rows = header().theta_deg.size(), columns = header().phi_deg.size();
  Imf::OutputPart part(*output_, static_cast<int>(w));
  // Some rows at a time in single precision: a whole copy of a slab would be 100 MB.
  const std::size_t block =
      std::max<std::size_t>((4 << 20) / (columns * channels() * sizeof(float)) / 32 * 32, 32);
  std::vector<float> buffer;
  for (std::size_t row = 0; row < rows; row += block) {
    const std::size_t now = std::min(block, rows - row), first = row * columns, count = now * columns;
    buffer.resize(count * channels());
    for (std::size_t i = 0; i < count; ++i) buffer[i] = static_cast<float>(slab.phase_function[first + i]);
    for (std::size_t s = 1; s < channels(); ++s)
      for (std::size_t i = 0; i < count; ++i)
        buffer[s * count + i] = static_cast<float>(slab.phase_matrix[16 * (first + i) + 4 * s]);
    if (const auto bad =
            std::find_if(buffer.begin(), buffer.end(), [](float v) { return !std::isfinite(v); });
        bad != buffer.end()) {
      const std::size_t i = first + static_cast<std::size_t>(bad - buffer.begin()) % count;
      throw RunError(fmt::format(
          "cannot write {}: the value at wavelength {} nm, theta {} deg, phi {} deg is too large for "
          "OpenEXR's 32 bits",
          file_.name().string(), header().wavelength_m[w] * 1e9, header().theta_deg[i / columns],
          header().phi_deg[i % columns]));
    }
    Imf::FrameBuffer frame;
    for (std::size_t s = 0; s < channels(); ++s)
      frame.insert(
          channel_name(s, header().wavelength_m[w]),
          Imf::Slice::Make(
              Imf::FLOAT, buffer.data() + s * count,
              Imath::Box2i(
                  Imath::V2i(0, static_cast<int>(row)),
                  Imath::V2i(static_cast<int>(columns) - 1, static_cast<int>(row + now) - 1))));
    part.setFrameBuffer(frame);
    part.writePixels(static_cast<int>(now));
  }
  Imf::Header& kept = parts_[w];
  kept.insert("scatteringCrossSection", Imf::DoubleAttribute(slab.scattering_cross_section));
  kept.insert("extinctionCrossSection", Imf::DoubleAttribute(slab.extinction_cross_section));
  kept.insert(
      "errorEstimate",
      Imf::FloatVectorAttribute(std::vector<float>(slab.error_estimate.begin(), slab.error_estimate.end())));
  if (!header().orders.empty()) {
    std::string energies;
    for (const double energy : slab.order_energy) energies += fixed_length(energy);
    kept.insert("orderEnergy", Imf::StringAttribute(energies));
  }
} catch (const RunError&) {
  throw;
} catch (const std::exception& error) {
  // OpenEXR throws its own exceptions from what our stream threw; the message keeps the reason.
  throw RunError(
      stream_->out().failed() ? disk_error(file_.name(), stream_->out().error())
                              : fmt::format("cannot write {}: {}", file_.name().string(), error.what()));
}

void ExrSink::complete(double seconds) {
  close();
  if (stream_->out().failed()) throw RunError(disk_error(file_.name(), stream_->out().error()));
  for (Imf::Header& part : parts_) part.insert("seconds", Imf::DoubleAttribute(seconds));
  const std::string headers = header_bytes();
  if (headers.size() != header_size_)
    throw std::logic_error(
        "the headers of an OpenEXR file changed their length between start() and complete()");
  stream_->out().seek(0);
  stream_->out().write(headers);
  stream_->out().flush();
  file_.commit();
}

class ExrSource final : public Source {
public:
  explicit ExrSource(const std::filesystem::path& path);
  [[nodiscard]] const TableHeader& header() const override { return header_; }
  [[nodiscard]] double seconds() const override { return seconds_; }
  [[nodiscard]] Slab read(std::size_t wavelength, const SlabPart& part) override;

private:
  void load_header();
  [[noreturn]] void refuse(const std::string& why) const {
    throw InputError(fmt::format("{}: {}", path_.string(), why));
  }
  template <class A>
  [[nodiscard]] auto attribute(int part, const char* name) const {
    const auto* found = input_->header(part).findTypedAttribute<A>(name);
    if (!found) refuse(fmt::format("it has no attribute {}; is it a table made by scatter?", name));
    return found->value();
  }

  std::filesystem::path path_;
  std::unique_ptr<Imf::MultiPartInputFile> input_;
  TableHeader header_;
  double seconds_ = 0;
};

ExrSource::ExrSource(const std::filesystem::path& path) : path_(path) {
  try {
    input_ = std::make_unique<Imf::MultiPartInputFile>(path.c_str());
  } catch (const std::exception& error) {
    refuse(fmt::format("it is not a readable OpenEXR file ({})", error.what()));
  }
  load_header();
}

void ExrSource::load_header() {
  const std::string theta = attribute<Imf::StringAttribute>(0, "thetaDegrees");
  const std::string phi = attribute<Imf::StringAttribute>(0, "phiDegrees");
  try {
    header_.theta_deg = parse_grid(theta);
    header_.phi_deg = parse_grid(phi);
    if (input_->header(0).findTypedAttribute<Imf::StringAttribute>("orders"))
      for (const double p : parse_numbers(attribute<Imf::StringAttribute>(0, "orders")))
        header_.orders.push_back(static_cast<int>(p));
  } catch (const InputError& error) {
    refuse(fmt::format("its grid cannot be read: {}", error.what()));
  }
  for (int part = 0; part < input_->parts(); ++part) {
    header_.wavelength_m.push_back(attribute<Imf::DoubleAttribute>(part, "wavelength"));
    if (input_->header(part).findTypedAttribute<Imf::DoubleAttribute>("refractiveIndexRe"))
      header_.index.emplace_back(
          attribute<Imf::DoubleAttribute>(part, "refractiveIndexRe"),
          attribute<Imf::DoubleAttribute>(part, "refractiveIndexIm"));
    const auto size = input_->header(part).dataWindow().size();
    if (size.x + 1 != static_cast<int>(header_.phi_deg.size()) ||
        size.y + 1 != static_cast<int>(header_.theta_deg.size()))
      refuse(fmt::format("part {} has not the size of its grid of theta and phi", part));
  }
  header_.stokes =
      input_->header(0).channels().findChannel(channel_name(1, header_.wavelength_m[0])) != nullptr;
  Provenance& made = header_.provenance;
  made.command = attribute<Imf::StringAttribute>(0, "command");
  made.version = attribute<Imf::StringAttribute>(0, "scatterVersion");
  made.device = attribute<Imf::StringAttribute>(0, "device");
  made.method = attribute<Imf::StringAttribute>(0, "method");
  made.created = attribute<Imf::StringAttribute>(0, "created");
  for (auto it = input_->header(0).begin(); it != input_->header(0).end(); ++it) {
    const std::string name = it.name();
    if (name.starts_with(constant_prefix))
      made.constants.emplace_back(
          name.substr(std::string(constant_prefix).size()), attribute<Imf::StringAttribute>(0, name.c_str()));
  }
  seconds_ = attribute<Imf::DoubleAttribute>(0, "seconds");
  try {
    check_header(header_);
  } catch (const InputError& error) {
    refuse(error.what());
  }
}

Slab ExrSource::read(std::size_t w, const SlabPart& wanted) {
  if (w >= header_.wavelength_m.size() || wanted.phi.value_or(0) >= header_.phi_deg.size())
    throw std::out_of_range("wavelength or azimuth beyond the table");
  const std::size_t rows = header_.theta_deg.size(), columns = header_.phi_deg.size();
  const std::size_t channels = header_.stokes && wanted.matrix ? 4 : 1;
  const int index = static_cast<int>(w);
  Slab slab;
  for (std::size_t s = 0; s < channels; ++s)
    if (!input_->header(index).channels().findChannel(channel_name(s, header_.wavelength_m[w])))
      refuse(fmt::format("part {} has no channel {}", index, channel_name(s, header_.wavelength_m[w])));
  const std::size_t block =
      std::max<std::size_t>((4 << 20) / (columns * channels * sizeof(float)) / 32 * 32, 32);
  std::vector<float> buffer;
  try {
    Imf::InputPart part(*input_, index);
    const Imath::V2i origin = input_->header(index).dataWindow().min;
    for (std::size_t row = 0; row < rows; row += block) {
      const std::size_t now = std::min(block, rows - row), count = now * columns;
      const int top = origin.y + static_cast<int>(row), bottom = top + static_cast<int>(now) - 1;
      buffer.resize(count * channels);
      Imf::FrameBuffer frame;
      for (std::size_t s = 0; s < channels; ++s)
        frame.insert(
            channel_name(s, header_.wavelength_m[w]),
            Imf::Slice::Make(
                Imf::FLOAT, buffer.data() + s * count,
                Imath::Box2i(
                    Imath::V2i(origin.x, top),
                    Imath::V2i(origin.x + static_cast<int>(columns) - 1, bottom))));
      part.setFrameBuffer(frame);
      part.readPixels(top, bottom);
      const std::size_t first = wanted.phi.value_or(0), step = wanted.phi ? columns : 1;
      for (std::size_t i = first; i < count; i += step) {
        slab.phase_function.push_back(static_cast<double>(buffer[i]));
        for (std::size_t s = 1; s < channels; ++s)
          slab.stokes.push_back(static_cast<double>(buffer[s * count + i]));
      }
    }
    const std::vector<float> error = attribute<Imf::FloatVectorAttribute>(index, "errorEstimate");
    slab.error_estimate.assign(error.begin(), error.end());
    if (!header_.orders.empty())
      slab.order_energy = parse_numbers(attribute<Imf::StringAttribute>(index, "orderEnergy"));
  } catch (const InputError&) {
    throw;
  } catch (const std::exception& error) {
    refuse(fmt::format(
        "wavelength {} cannot be read: {}", wavelength_name(header_.wavelength_m[w]), error.what()));
  }
  slab.scattering_cross_section = attribute<Imf::DoubleAttribute>(index, "scatteringCrossSection");
  slab.extinction_cross_section = attribute<Imf::DoubleAttribute>(index, "extinctionCrossSection");
  return slab;
}

} // namespace

std::unique_ptr<Sink>
make_exr_sink(const std::string& path, const TableHeader& header, const FileOptions& options) {
  if (header.amplitudes || header.per_order)
    throw InputError(fmt::format(
        "{}: OpenEXR cannot hold complex amplitudes in double precision; write .nc or .json", path));
  std::set<std::string> names;
  for (const double wavelength : header.wavelength_m)
    if (!names.insert(wavelength_name(wavelength)).second)
      throw InputError(fmt::format(
          "{}: OpenEXR names channels by wavelength to 1e-6 nm, and {} is there twice; write .nc or .json",
          path, wavelength_name(wavelength)));
  std::set<std::string> constants;
  for (const auto& [key, value] : header.provenance.constants)
    if (key.empty() || (constant_prefix + key).size() > 255 || !constants.insert(key).second)
      throw InputError(
          fmt::format("{}: '{}' cannot name a constant in OpenEXR: empty, too long or twice", path, key));
  // OpenEXR computes the size of a chunk in 32 bits (its issue 824).
  const double channels = header.matrix ? 4 : 1;
  const double chunk_bytes =
      static_cast<double>(header.phi_deg.size()) * channels * sizeof(float) * chunk_rows(options.compression);
  if (chunk_bytes >= 2147483648.0 || static_cast<double>(header.theta_deg.size()) >= 2147483648.0)
    throw InputError(
        fmt::format("{}: {} azimuths are too many for OpenEXR; write .nc", path, header.phi_deg.size()));
  auto sink = std::make_unique<ExrSink>(path, options);
  if (options.compression == Compression::none)
    check_free_disk(
        path, static_cast<double>(header.wavelength_m.size()) * static_cast<double>(header.theta_deg.size()) *
                  (static_cast<double>(header.phi_deg.size()) * channels + 1) * sizeof(float));
  return sink;
}

std::unique_ptr<Source> open_exr(const std::filesystem::path& path) {
  return std::make_unique<ExrSource>(path);
}

} // namespace scatter::table
