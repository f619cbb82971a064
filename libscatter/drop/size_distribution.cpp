#include <scatter/drop/size_distribution.hpp>
#include <scatter/optics/errors.hpp>
#include <scatter/optics/units.hpp>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <map>
#include <numeric>
#include <sstream>

namespace scatter::drop {
namespace {

std::string number_text(double value) {
  std::ostringstream text;
  text.precision(15);
  text << value;
  return text.str();
}

[[noreturn]] void refuse(const std::string& what, double value, const std::string& should) {
  throw InputError(what + " " + number_text(value) + " is not possible: " + should);
}

/// A number with the given unit behind it: "5mm/h".
double number_with_unit(std::string_view text, std::string_view unit, const std::string& example) {
  if (!text.ends_with(unit))
    throw InputError(quote(text) + " does not end with " + std::string(unit) + "; write " + example);
  return parse_number(text.substr(0, text.size() - unit.size()));
}

/// "3/mm" -> 3000 per metre.
double inverse_length(std::string_view text) {
  const auto slash = text.find('/');
  if (slash == std::string_view::npos || slash == 0)
    throw InputError(quote(text) + " is not an inverse length; write one such as 3/mm");
  return parse_number(text.substr(0, slash)) / parse_length(std::string("1").append(text.substr(slash + 1)));
}

double positive(double value, std::string_view text) {
  if (!(value > 0)) throw InputError(quote(text) + " is not positive");
  return value;
}

/// The parts "name=value" behind the colon; every one is asked for exactly once.
class Parts {
public:
  Parts(std::string kind, std::string_view text, std::string example)
      : kind_(std::move(kind)), example_(std::move(example)) {
    while (!text.empty()) {
      const auto end = std::min(text.find(','), text.size());
      const std::string_view part = text.substr(0, end);
      const auto equals = part.find('=');
      if (equals == std::string_view::npos)
        throw InputError(kind_ + ": " + quote(part) + " is no name=value; write " + example_);
      if (!parts_.emplace(part.substr(0, equals), part.substr(equals + 1)).second)
        throw InputError(kind_ + ": " + quote(part.substr(0, equals)) + " is given twice");
      text.remove_prefix(std::min(end + 1, text.size()));
    }
  }
  template <typename Reader>
  std::optional<double> find(const std::string& name, Reader&& reader) {
    const auto found = parts_.find(name);
    if (found == parts_.end()) return std::nullopt;
    const std::string text = found->second;
    parts_.erase(found);
    try {
      return reader(text);
    } catch (const InputError& error) {
      throw InputError(kind_ + ": " + name + ": " + error.what());
    }
  }
  template <typename Reader>
  double get(const std::string& name, Reader&& reader) {
    const auto value = find(name, reader);
    if (!value) throw InputError(kind_ + ": " + name + " is missing; write " + example_);
    return *value;
  }
  [[nodiscard]] bool has(const std::string& name) const { return parts_.contains(name); }
  void finish() const {
    if (!parts_.empty())
      throw InputError(kind_ + ": unknown name " + quote(parts_.begin()->first) + "; write " + example_);
  }

private:
  std::string kind_, example_;
  std::map<std::string, std::string> parts_;
};

std::string trimmed(std::string_view text) {
  const auto first = text.find_first_not_of(" \t\r");
  if (first == std::string_view::npos) return {};
  return std::string(text.substr(first, text.find_last_not_of(" \t\r") - first + 1));
}

} // namespace

SizeDistribution SizeDistribution::lognormal(double median_m, double sigma) {
  if (!(median_m > 0) || !std::isfinite(median_m))
    refuse("the median radius", median_m, "use a positive length");
  if (!(sigma > 1 && sigma <= 10))
    refuse(
        "sigma", sigma,
        "it is the geometric standard deviation, above 1 (all drops alike) and up to 10, such as 1.3");
  SizeDistribution made;
  made.kind_ = Kind::lognormal;
  made.log_median_ = std::log(median_m);
  made.log_sigma_ = std::log(sigma);
  made.name_ = "lognormal:median=" + number_text(median_m) + "m,sigma=" + number_text(sigma);
  return made;
}

SizeDistribution SizeDistribution::gamma(double mu, double lambda_per_m) {
  if (!(mu > -1 && mu <= 1000))
    refuse("mu", mu, "use a number above -1 (else the drops cannot be counted) and up to 1000");
  if (!(lambda_per_m > 0) || !std::isfinite(lambda_per_m))
    refuse("lambda", lambda_per_m, "use a positive inverse length, such as 3/mm");
  SizeDistribution made;
  made.kind_ = Kind::gamma;
  made.mu_ = mu;
  made.lambda_per_m_ = lambda_per_m;
  made.name_ = "gamma:mu=" + number_text(mu) + ",lambda=" + number_text(lambda_per_m) + "/m";
  return made;
}

SizeDistribution SizeDistribution::gamma_effective(double radius_m, double variance) {
  if (!(radius_m > 0) || !std::isfinite(radius_m))
    refuse("the effective radius", radius_m, "use a positive length");
  if (!(variance > 0 && variance < 0.5))
    refuse("the effective variance", variance, "use a number between 0 and 0.5, such as 0.1");
  return gamma((1 - 3 * variance) / variance, 1 / (2 * radius_m * variance));
}

SizeDistribution SizeDistribution::marshall_palmer(double rate_mm_per_h, double intercept_per_m4) {
  if (!(rate_mm_per_h > 0 && rate_mm_per_h <= 1000))
    refuse("the rain rate", rate_mm_per_h, "use one above 0 and up to 1000 mm/h, such as 5mm/h");
  SizeDistribution made = gamma(0, 4.1e3 * std::pow(rate_mm_per_h, -0.21));
  made.set_intercept(intercept_per_m4);
  made.name_ =
      "marshall-palmer:rate=" + number_text(rate_mm_per_h) + "mm/h,N0=" + number_text(intercept_per_m4 / 1e3);
  return made;
}

SizeDistribution SizeDistribution::list(std::vector<double> radius_m, std::vector<double> number) {
  if (radius_m.empty() || radius_m.size() != number.size())
    throw InputError("a list of drops needs radii and one number of drops for each");
  for (const double radius : radius_m)
    if (!(radius > 0) || !std::isfinite(radius)) refuse("the radius", radius, "use a positive length");
  double sum = 0;
  for (const double n : number) {
    if (!(n >= 0)) refuse("the number of drops", n, "use a number from 0");
    sum += n;
  }
  if (!(sum > 0) || !std::isfinite(sum)) throw InputError("a list of drops needs some drops");
  SizeDistribution made;
  made.kind_ = Kind::list;
  made.name_ = "list";
  made.radius_m_ = std::move(radius_m);
  made.number_ = std::move(number);
  return made;
}

void SizeDistribution::cut(double smallest_m, double largest_m) {
  if (kind_ == Kind::list) throw InputError("a list of drops is cut by leaving out lines");
  if (!(smallest_m >= 0 && largest_m > smallest_m))
    throw InputError("the first radius must be smaller than the last one");
  const auto [low, high] = range(1e-12);
  if (!(smallest_m < high && largest_m > low))
    throw InputError(
        "there are no drops between the radii " + number_text(smallest_m * 1e6) + " um and " +
        number_text(largest_m * 1e6) + " um: the distribution lives between " + number_text(low * 1e6) +
        " um and " + number_text(high * 1e6) + " um");
  const double before = moment(0);
  cut_ = true;
  smallest_m_ = smallest_m;
  largest_m_ = largest_m;
  share_kept_ = 1;
  share_kept_ = moment(0);
  number_per_m3_ *= share_kept_ / before;
}

void SizeDistribution::set_intercept(double intercept) {
  if (kind_ != Kind::gamma) throw InputError("N0 belongs to a gamma distribution");
  if (!(intercept > 0) || !std::isfinite(intercept)) refuse("N0", intercept, "use a positive number");
  number_per_m3_ =
      intercept * std::exp(std::lgamma(mu_ + 1) - (mu_ + 1) * std::log(lambda_per_m_)) * share_kept_;
}

double SizeDistribution::log_shape(double log_radius, double power) const {
  // ln of r^power density(r), without cut.
  if (kind_ == Kind::lognormal) {
    const double z = (log_radius - log_median_) / log_sigma_;
    return (power - 1) * log_radius - z * z / 2 - std::log(log_sigma_ * std::sqrt(2 * pi));
  }
  const double log_diameter = log_radius + std::log(2.0);
  return power * log_radius + mu_ * log_diameter - lambda_per_m_ * std::exp(log_diameter) +
         (mu_ + 1) * std::log(lambda_per_m_) - std::lgamma(mu_ + 1) + std::log(2.0);
}

double SizeDistribution::uncut_density(double radius_m) const {
  return std::exp(log_shape(std::log(radius_m), 0));
}

double SizeDistribution::density(double radius_m) const {
  if (kind_ == Kind::list) throw InputError("a list of drops has no density");
  if (!(radius_m > 0) || (cut_ && (radius_m < smallest_m_ || radius_m > largest_m_))) return 0;
  return uncut_density(radius_m) / share_kept_;
}

double SizeDistribution::moment(double power) const {
  if (kind_ == Kind::list) {
    double sum = 0, all = 0;
    for (std::size_t i = 0; i < radius_m_.size(); ++i) {
      sum += number_[i] * std::pow(radius_m_[i], power);
      all += number_[i];
    }
    return sum / all;
  }
  if (!cut_) {
    if (kind_ == Kind::lognormal)
      return std::exp(power * log_median_ + power * power * log_sigma_ * log_sigma_ / 2);
    return std::exp(
        std::lgamma(mu_ + power + 1) - std::lgamma(mu_ + 1) - power * std::log(2 * lambda_per_m_));
  }
  // Midpoints after Sidi's substitution, between the cut and where the integrand has faded.
  double peak = kind_ == Kind::lognormal ? log_median_ + power * log_sigma_ * log_sigma_
                                         : std::log((mu_ + power + 1) / (2 * lambda_per_m_));
  const double low_end = smallest_m_ > 0 ? std::log(smallest_m_) : -1e3, high_end = std::log(largest_m_);
  peak = std::clamp(peak, low_end, high_end);
  const double top = log_shape(peak, power + 1);
  const auto edge = [&](double end, double direction) {
    double at = peak;
    for (double step = 0.01; (end - at) * direction > 0 && log_shape(at, power + 1) > top - 45; step *= 1.1)
      at += direction * step;
    return direction > 0 ? std::min(at, end) : std::max(at, end);
  };
  const double low = edge(low_end, -1), high = edge(high_end, 1);
  constexpr int steps = 4096;
  double sum = 0;
  for (int i = 0; i < steps; ++i) {
    const double t = (i + 0.5) / steps;
    const double u = low + (high - low) * (t - std::sin(2 * pi * t) / (2 * pi));
    sum += 2 * std::pow(std::sin(pi * t), 2) * std::exp(log_shape(u, power + 1));
  }
  return sum * (high - low) / steps / share_kept_;
}

double SizeDistribution::effective_variance() const {
  return moment(4) * moment(2) / (moment(3) * moment(3)) - 1;
}

std::pair<double, double> SizeDistribution::range(double share) const {
  if (kind_ == Kind::list) {
    const auto [low, high] = std::minmax_element(radius_m_.begin(), radius_m_.end());
    return {*low, *high};
  }
  const auto reach = [&](double power, double direction) {
    double at = kind_ == Kind::lognormal ? log_median_ + (power - 1) * log_sigma_ * log_sigma_
                                         : std::log((mu_ + power) / (2 * lambda_per_m_));
    const double floor = log_shape(at, power) + std::log(share);
    double outside = at;
    for (double step = 0.01; log_shape(outside, power) > floor; step *= 1.3) {
      at = outside;
      outside += direction * step;
    }
    for (int i = 0; i < 60; ++i) {
      const double middle = (at + outside) / 2;
      (log_shape(middle, power) > floor ? at : outside) = middle;
    }
    return std::exp(outside);
  };
  double low = reach(3, -1), high = reach(5, 1);
  if (cut_) {
    low = std::max(low, smallest_m_);
    high = std::min(high, largest_m_);
    // A cut in a tail leaves what it leaves.
    if (!(low < high)) {
      high = largest_m_;
      low = std::max(smallest_m_, high / 100);
    }
  }
  return {low, high};
}

SizeDistribution parse_size_distribution(std::string_view text) {
  const auto colon = text.find(':');
  const std::string kind(text.substr(0, colon));
  const std::string_view rest = colon == std::string_view::npos ? "" : text.substr(colon + 1);
  const auto length = [](const std::string& value) { return parse_length(value); };
  const auto number = [](const std::string& value) { return parse_number(value); };
  const auto made = [&]() -> SizeDistribution {
    if (kind == "list") {
      if (rest.empty()) throw InputError("list: the file is missing; write list:FILE");
      return read_size_list(std::filesystem::path(std::string(rest)));
    }
    const auto cut_and_finish = [](Parts& parts, SizeDistribution distribution) {
      const auto from = parts.find("from", [](const std::string& v) { return parse_length(v); });
      const auto to = parts.find("to", [](const std::string& v) { return parse_length(v); });
      parts.finish();
      if (from && to && !(*from < *to)) throw InputError("from: must be smaller than to");
      if (from || to) distribution.cut(from.value_or(0), to.value_or(1e3));
      return distribution;
    };
    if (kind == "lognormal") {
      Parts parts(kind, rest, "lognormal:median=10um,sigma=1.3");
      const double median = parts.get("median", length), sigma = parts.get("sigma", number);
      return cut_and_finish(parts, SizeDistribution::lognormal(median, sigma));
    }
    if (kind == "gamma") {
      Parts parts(kind, rest, "gamma:mu=2,lambda=3/mm or gamma:effective-radius=10um,effective-variance=0.1");
      if (parts.has("effective-radius") || parts.has("effective-variance")) {
        const double radius = parts.get("effective-radius", length);
        const double variance = parts.get("effective-variance", number);
        return cut_and_finish(parts, SizeDistribution::gamma_effective(radius, variance));
      }
      const double mu = parts.get("mu", number);
      const double lambda =
          parts.get("lambda", [](const std::string& v) { return positive(inverse_length(v), v); });
      return cut_and_finish(parts, SizeDistribution::gamma(mu, lambda));
    }
    if (kind == "marshall-palmer") {
      Parts parts(kind, rest, "marshall-palmer:rate=5mm/h");
      const double rate = parts.get("rate", [](const std::string& v) {
        return positive(number_with_unit(v, "mm/h", "a rain rate such as 5mm/h"), v);
      });
      const double intercept =
          parts.find("N0", [](const std::string& v) { return positive(parse_number(v), v); }).value_or(8000);
      return cut_and_finish(parts, SizeDistribution::marshall_palmer(rate, intercept * 1e3));
    }
    throw InputError(
        quote(kind) +
        " is no size distribution; use lognormal:median=10um,sigma=1.3, gamma:mu=2,lambda=3/mm, "
        "marshall-palmer:rate=5mm/h or list:FILE");
  };
  return made();
}

SizeDistribution read_size_list(const std::filesystem::path& file) {
  std::ifstream stream(file);
  if (!stream || std::filesystem::is_directory(file))
    throw InputError(quote(file.string()) + " cannot be read; give a file of lines such as 10um,0.5");
  std::vector<double> radius_m, number;
  double unit = 0; ///< of a header; 0: every radius has its own
  bool first = true;
  std::string line;
  for (int row = 1; std::getline(stream, line); ++row) {
    if (row > 1000000) throw InputError(quote(file.string()) + " has more than a million lines");
    line = trimmed(line);
    if (line.empty() || line[0] == '#') continue;
    const auto comma = line.find(',');
    const auto wrong = [&](std::size_t column, const std::string& why) {
      return InputError(
          file.string() + ":" + std::to_string(row) + ":" + std::to_string(column + 1) + ": " + why);
    };
    if (comma == std::string::npos || line.find(',', comma + 1) != std::string::npos)
      throw wrong(0, quote(line) + " is not a radius and a number; write a line such as 10um,0.5");
    const std::string left = trimmed(std::string_view(line).substr(0, comma)),
                      right = trimmed(std::string_view(line).substr(comma + 1));
    if (first && left.starts_with("radius")) {
      first = false;
      if (left == "radius") continue;
      try {
        unit = left.starts_with("radius_") ? parse_length(std::string("1").append(left, 7))
                                           : throw InputError("");
      } catch (const InputError&) {
        throw wrong(0, "the column " + quote(left) + " has no known unit; name it radius_um or radius_mm");
      }
      continue;
    }
    first = false;
    std::size_t column = 0;
    try {
      const double radius = unit > 0 ? positive(parse_number(left), left) * unit : parse_length(left);
      column = comma + 1;
      const double count = parse_number(right);
      if (count < 0) throw InputError(quote(right) + " is negative; numbers of drops are not");
      radius_m.push_back(radius);
      number.push_back(count);
    } catch (const InputError& error) {
      throw wrong(column, error.what());
    }
  }
  if (stream.bad()) throw RunError(quote(file.string()) + " cannot be read to its end");
  if (radius_m.empty())
    throw InputError(quote(file.string()) + " holds no drops; write lines such as 10um,0.5");
  if (!(std::accumulate(number.begin(), number.end(), 0.0) > 0))
    throw InputError(quote(file.string()) + " holds no drops: all its numbers are 0");
  SizeDistribution made = SizeDistribution::list(std::move(radius_m), std::move(number));
  return made;
}

} // namespace scatter::drop
