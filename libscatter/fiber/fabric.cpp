#include <scatter/fiber/fabric.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/spelling.hpp>
#include <scatter/optics/units.hpp>

#include <embedded/fabric_imaginary_asymmetric.hpp>
#include <embedded/fabric_imaginary_shantung.hpp>
#include <embedded/fabric_linen_plain.hpp>
#include <embedded/fabric_polyester_satin_back.hpp>
#include <embedded/fabric_polyester_satin_front.hpp>
#include <embedded/fabric_silk_crepe_de_chine.hpp>
#include <embedded/fabric_silk_shot.hpp>
#include <embedded/fabric_velvet.hpp>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <initializer_list>
#include <iterator>
#include <set>
#include <utility>

namespace scatter::fiber {
namespace {

using Json = nlohmann::json;

constexpr std::pair<const char*, std::string_view> fabrics[] = {
    {"linen-plain", embedded::fabric_linen_plain},
    {"silk-crepe-de-chine", embedded::fabric_silk_crepe_de_chine},
    {"polyester-satin-front", embedded::fabric_polyester_satin_front},
    {"polyester-satin-back", embedded::fabric_polyester_satin_back},
    {"silk-shot", embedded::fabric_silk_shot},
    {"velvet", embedded::fabric_velvet},
    {"imaginary-shantung", embedded::fabric_imaginary_shantung},
    {"imaginary-asymmetric", embedded::fabric_imaginary_asymmetric},
};

std::string joined(const std::vector<std::string>& names) {
  std::string list;
  for (const std::string& name : names) list += (list.empty() ? "" : ", ") + name;
  return list;
}

/// "did you mean X?" if X is near, else all of them.
std::string advice(const std::string& word, const std::vector<std::string>& known) {
  if (const auto name = nearest_name(word, known)) return "did you mean " + *name + "?";
  return "known are " + joined(known);
}

std::string read_text(const std::string& file) {
  constexpr std::size_t most = 1 << 20;
  std::ifstream stream(file, std::ios::binary);
  std::string text(most + 1, '\0');
  if (stream) stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad() || (!stream.is_open()) || (stream.fail() && !stream.eof()))
    throw InputError(quote(file) + " cannot be read");
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > most) throw InputError(quote(file) + " is larger than 1 MB: no description of threads");
  return text;
}

/// Throws with line and column; also for a name that stands twice in one object, which JSON leaves open.
Json parse_json(std::string_view text, const std::string& name) {
  std::vector<std::set<std::string>> open;
  const auto watch = [&](int, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::object_start) open.emplace_back();
    if (event == Json::parse_event_t::object_end) open.pop_back();
    if (event == Json::parse_event_t::key && !open.back().insert(value.get<std::string>()).second)
      throw InputError(name + ": " + quote(value.get<std::string>()) + " stands twice");
    return true;
  };
  try {
    return Json::parse(text, watch);
  } catch (const Json::exception& error) {
    // "[json.exception...] parse error at line 3, column 7: ...", or "... number overflow parsing '1e999'"
    const std::string message = error.what();
    const auto at = message.find("at line"), end_of_tag = message.find("] ");
    throw InputError(
        name + ": no JSON: " +
        (at != message.npos ? message.substr(at)
                            : message.substr(end_of_tag == message.npos ? 0 : end_of_tag + 2)));
  }
}

/// The fields of one JSON object, for messages such as "satin.json: thread 2: kd: ...".
class Fields {
public:
  Fields(const Json& object, std::string where, const std::vector<std::string>& known)
      : object_(object), where_(std::move(where)) {
    if (!object.is_object())
      throw InputError(where_ + "this must be a JSON object, { \"name\": value, ... }");
    for (const auto& [name, value] : object.items())
      if (std::ranges::find(known, name) == known.end())
        throw InputError(where_ + quote(name) + " is no field; " + advice(name, known));
  }

  [[nodiscard]] bool has(const char* name) const { return object_.contains(name); }
  [[nodiscard]] const Json& at(const char* name) const {
    if (!has(name)) throw InputError(where_ + name + " is missing");
    return object_.at(name);
  }
  [[nodiscard]] double number(const char* name) const { return number(at(name), name, "a number"); }
  [[nodiscard]] double number(const char* name, double otherwise) const {
    return has(name) ? number(name) : otherwise;
  }
  [[nodiscard]] std::vector<double> numbers(const char* name) const {
    const Json& list = at(name);
    constexpr const char* right = "a list of numbers, such as [-25, 25]";
    if (!list.is_array()) refuse(list, name, right);
    std::vector<double> values;
    for (const Json& entry : list) values.push_back(number(entry, name, right));
    return values;
  }
  [[nodiscard]] std::string text(const char* name) const {
    if (!has(name)) return {};
    if (!at(name).is_string()) refuse(at(name), name, "text");
    return at(name).get<std::string>();
  }

private:
  [[nodiscard]] double number(const Json& value, const char* name, const char* right) const {
    if (!value.is_number() || !std::isfinite(value.get<double>())) refuse(value, name, right);
    return value.get<double>();
  }
  [[noreturn]] void refuse(const Json& value, const char* name, const char* right) const {
    const std::string dumped = value.dump(-1, ' ', false, Json::error_handler_t::replace);
    throw InputError(where_ + name + ": " + quote(dumped) + " is not " + right);
  }

  const Json& object_;
  std::string where_;
};

const std::vector<std::string> thread_fields{"name",        "source",      "eta",    "kd",
                                             "gamma_s_deg", "gamma_v_deg", "albedo", "albedo_scale"};

ThreadParameters thread_of(const Fields& fields, const std::string& where) {
  ThreadParameters thread;
  static_cast<void>(fields.text("name"));
  static_cast<void>(fields.text("source"));
  thread.eta = fields.number("eta");
  thread.kd = fields.number("kd");
  thread.gamma_s = fields.number("gamma_s_deg") * radians_per_degree;
  thread.gamma_v = fields.number("gamma_v_deg") * radians_per_degree;
  const std::vector<double> albedo = fields.numbers("albedo");
  if (albedo.size() != 3)
    throw InputError(
        where + "albedo: " + std::to_string(albedo.size()) + " numbers; three are needed: red, green, blue");
  const double scale = fields.number("albedo_scale", 1);
  thread.albedo = scale * glm::dvec3(albedo[0], albedo[1], albedo[2]);
  check(thread, where);
  return thread;
}

} // namespace

std::vector<std::string> fabric_names() {
  std::vector<std::string> names;
  for (const auto& [name, text] : fabrics) names.emplace_back(name);
  return names;
}

Fabric load_fabric(const std::string& name_or_file) {
  for (const auto& [name, text] : fabrics)
    if (name_or_file == name) return parse_fabric(text, name);
  if (name_or_file.find_first_of("./") == name_or_file.npos && !std::ifstream(name_or_file).is_open())
    throw InputError(
        quote(name_or_file) + " is neither a fabric nor a file; " + advice(name_or_file, fabric_names()));
  return parse_fabric(read_text(name_or_file), name_or_file);
}

Fabric parse_fabric(std::string_view text, const std::string& name) {
  const Json json = parse_json(text, name);
  Fabric fabric;
  fabric.name = name;
  const Fields fields(json, name + ": ", {"description", "source", "masking_deg", "threads"});
  fabric.description = fields.text("description");
  fabric.source = fields.text("source");
  if (fields.has("masking_deg"))
    fabric.weave.masking_width = fields.number("masking_deg") * radians_per_degree;
  const Json& threads = fields.at("threads");
  if (!threads.is_array() || threads.empty())
    throw InputError(name + ": threads: this must be a list of one or more threads, [ {...}, {...} ]");
  std::vector<std::string> known = thread_fields;
  for (const char* const more : {"coverage", "offsets_deg", "lengths", "direction_deg"})
    known.emplace_back(more);
  for (const Json& entry : threads) {
    const std::size_t number = fabric.weave.threads.size() + 1;
    const std::string where = name + ": thread " + std::to_string(number) + ": ";
    const Fields thread(entry, where, known);
    WeaveThread made;
    made.thread = thread_of(thread, where);
    made.coverage = thread.number("coverage");
    if (number > 2 && !thread.has("direction_deg"))
      throw InputError(where + "direction_deg is missing; threads 1 and 2 alone have directions by default");
    made.direction = thread.number("direction_deg", number == 2 ? 90 : 0) * radians_per_degree;
    for (const double offset : thread.numbers("offsets_deg"))
      made.curve.offsets.push_back(offset * radians_per_degree);
    made.curve.lengths = thread.numbers("lengths");
    fabric.weave.threads.push_back(std::move(made));
  }
  check(fabric.weave, name + ": ");
  return fabric;
}

ThreadParameters load_thread(const std::string& file) {
  return parse_thread(read_text(file), file);
}

ThreadParameters parse_thread(std::string_view text, const std::string& name) {
  const Json json = parse_json(text, name);
  const std::string where = name + ": ";
  return thread_of(Fields(json, where, thread_fields), where);
}

} // namespace scatter::fiber
