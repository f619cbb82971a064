#pragma once

#include <scatter/fiber/weave.hpp>

#include <string>
#include <string_view>
#include <vector>

/// Fabrics as data: the measured ones that come with the library, and files of one's own in the same form.
///
/// A fabric file is JSON, read strictly (unknown and repeated names are refused):
///
///   description   text, may be left out
///   source        text: where the numbers are from, may be left out
///   masking_deg   s of masking, 5..45; may be left out [20]
///   threads       list of one or more, each with
///     name            text, may be left out
///     eta             refractive index, above 1
///     kd              isotropic share of the volume's light, 0..1
///     gamma_s_deg     standard deviation of the surface lobe in theta_h, 0.01 .. below 90
///     gamma_v_deg     the same of the volume's
///     albedo          [red, green, blue]; with albedo_scale each 0..1
///     albedo_scale    factor on the three, may be left out [1]
///     coverage        share of the cloth's area; those of all threads add up to 1 or less
///     offsets_deg     of the tangent from the cloth, at the control points: two or more, -90..90
///     lengths         of the segments between them: one fewer, any unit; 0 is a jump
///     direction_deg   azimuth in the cloth, from x toward y; may be left out for thread 1 [0] and 2 [90]
namespace scatter::fiber {

struct Fabric {
  std::string name; ///< of a fabric of ours, or the file
  std::string description, source;
  Weave weave;
};

/// Names of the fabrics that come with the library: those of tables/fabrics.
[[nodiscard]] std::vector<std::string> fabric_names();

/// One of fabric_names(), or a file. Throws InputError: for a name that is neither, with the nearest name;
/// for a file that cannot be read, is larger than 1 MB, is no JSON (with line and column), or whose
/// fields are not as above (with file, thread and field).
[[nodiscard]] Fabric load_fabric(const std::string& name_or_file);

/// The text of a fabric file; name is for messages.
[[nodiscard]] Fabric parse_fabric(std::string_view text, const std::string& name);

/// One thread alone: the fields name, source, eta, kd, gamma_s_deg, gamma_v_deg, albedo, albedo_scale of a
/// fabric's thread. Throws InputError as load_fabric().
[[nodiscard]] ThreadParameters load_thread(const std::string& file);
[[nodiscard]] ThreadParameters parse_thread(std::string_view text, const std::string& name);

} // namespace scatter::fiber
