// The command line of `scatter phase`, one argument per line, read into a request as the program does.
// Whatever stands there, the outcome is a request that keeps its promises or an error of one line.
#include "../../apps/scatter/phase_options.hpp"

#include "check.hpp"
#include <scatter/optics/errors.hpp>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  std::vector<std::string> arguments;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  for (std::size_t begin = 0; begin < text.size();) {
    const std::size_t end = std::min(text.find('\n', begin), text.size());
    arguments.emplace_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  std::ranges::reverse(arguments); // as CLI11 wants them

  CLI::App verb("", "phase");
  scatter::app::PhaseOptions options;
  options.add_to(verb);
  try {
    verb.parse(arguments);
    const scatter::app::PhaseJob job = options.job();
    const auto& request = job.request;
    SCATTER_FUZZ_CHECK(request.shape.radius_m > 0 && std::isfinite(request.shape.radius_m));
    SCATTER_FUZZ_CHECK(std::abs(request.shape.volume() - 1) < 1e-9);
    SCATTER_FUZZ_CHECK(
        !request.wavelength_m.empty() && !request.theta_deg.empty() && !request.phi_deg.empty());
    SCATTER_FUZZ_CHECK(!request.orders.empty());
    SCATTER_FUZZ_CHECK(std::isfinite(request.sun_elevation_deg) && std::isfinite(request.sun_disc_deg));
    SCATTER_FUZZ_CHECK(!job.output.empty());
  } catch (const CLI::ParseError&) {
  } catch (const scatter::InputError& error) {
    const std::string_view message = error.what();
    SCATTER_FUZZ_CHECK(!message.empty() && message.size() < 1000);
    SCATTER_FUZZ_CHECK(std::ranges::none_of(message, [](unsigned char c) { return c < 0x20 || c == 0x7F; }));
  }
  return 0;
}
