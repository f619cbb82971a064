#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// How many drops there are of each size.
namespace scatter::drop {

/// A distribution of radii r (of the equal-volume sphere) [m]. Diameters are D = 2 r.
class SizeDistribution {
public:
  enum class Kind { lognormal, gamma, list };

  /// ln r is normally distributed: median [m], sigma the geometric standard deviation, 1 < sigma <= 10.
  [[nodiscard]] static SizeDistribution lognormal(double median_m, double sigma);
  /// n(D) ~ D^mu exp(-lambda D) (Ulbrich 1983), mu > -1 (a finite number of drops), lambda > 0 [1/m].
  [[nodiscard]] static SizeDistribution gamma(double mu, double lambda_per_m);
  /// The same by effective radius [m] and variance, 0 < variance < 1/2: n(r) ~ r^((1-3v)/v) exp(-r/(a v))
  /// (Hansen & Travis 1974, eq. 2.56).
  [[nodiscard]] static SizeDistribution gamma_effective(double radius_m, double variance);
  /// n(D) = N0 exp(-lambda D), N0 = 8000 m^-3 mm^-1 unless given [m^-4], lambda = 4.1 R^-0.21 mm^-1 at the
  /// rain rate R [mm/h] (Marshall & Palmer 1948): gamma with mu = 0.
  [[nodiscard]] static SizeDistribution marshall_palmer(double rate_mm_per_h, double intercept_per_m4 = 8e6);
  /// These radii [m] with numbers of drops in any unit.
  [[nodiscard]] static SizeDistribution list(std::vector<double> radius_m, std::vector<double> number);

  /// Only drops with smallest <= r <= largest [m]; the density keeps its shape and integrates to 1 again.
  /// Not for lists.
  void cut(double smallest_m, double largest_m);
  /// n(D) = N0 D^mu exp(-lambda D) with N0 [m^-4-mu]: from it follows how many drops a cubic metre holds.
  /// Gamma only.
  void set_intercept(double intercept);

  [[nodiscard]] Kind kind() const { return kind_; }
  /// As the command line takes it, with what was left open filled in: "lognormal:median=1e-05m,sigma=1.3".
  [[nodiscard]] const std::string& name() const { return name_; }
  /// Drops per metre of radius, as a share of all drops: integral 1. Not for lists.
  [[nodiscard]] double density(double radius_m) const;
  /// Mean of r^power [m^power], power > -1 - mu for a gamma. In closed form (relative error 1e-13), for cut
  /// distributions by quadrature (1e-10).
  [[nodiscard]] double moment(double power) const;
  /// <r^3> / <r^2> and <r^4> <r^2> / <r^3>^2 - 1 (Hansen & Travis 1974).
  [[nodiscard]] double effective_radius_m() const { return moment(3) / moment(2); }
  [[nodiscard]] double effective_variance() const;
  /// Drops per cubic metre; 0 where nobody said (log-normal, lists, gamma without N0).
  [[nodiscard]] double number_per_m3() const { return number_per_m3_; }

  /// The radii that count for light: outside, r^3 density (below) and r^5 density (above), which follow the
  /// geometric and the forward-scattering share per ln r, are less than `share` of their largest. For a cut
  /// distribution no further than the cut. Lists: the smallest and the largest.
  [[nodiscard]] std::pair<double, double> range(double share) const;
  [[nodiscard]] bool is_cut() const { return cut_; }

  [[nodiscard]] const std::vector<double>& radius_m() const { return radius_m_; } ///< lists only
  [[nodiscard]] const std::vector<double>& number() const { return number_; }     ///< lists only

private:
  [[nodiscard]] double uncut_density(double radius_m) const;
  [[nodiscard]] double log_shape(double log_radius, double power) const;

  Kind kind_ = Kind::list;
  std::string name_;
  double log_median_ = 0, log_sigma_ = 0; ///< log-normal
  double mu_ = 0, lambda_per_m_ = 0;      ///< gamma, of the diameter
  bool cut_ = false;
  double smallest_m_ = 0, largest_m_ = 0, share_kept_ = 1;
  double number_per_m3_ = 0;
  std::vector<double> radius_m_, number_;
};

/// "lognormal:median=10um,sigma=1.3", "gamma:mu=2,lambda=3/mm", "gamma:effective-radius=10um,
/// effective-variance=0.1", "marshall-palmer:rate=5mm/h", "list:FILE"; for all but lists also from= and to=
/// (radii beyond which there are no drops), for marshall-palmer N0= in m^-3 mm^-1.
/// Throws InputError with one line that names the part that is wrong and what would be right, or the file's
/// line and column.
[[nodiscard]] SizeDistribution parse_size_distribution(std::string_view text);

/// Comma-separated radius and number of drops per line; lines that begin with # and empty lines count for
/// nothing. Radii carry a unit (10um) unless the first line names the columns with one: radius_um,number.
/// Throws InputError that names file, line and column, RunError when reading fails.
[[nodiscard]] SizeDistribution read_size_list(const std::filesystem::path& file);

} // namespace scatter::drop
