#pragma once

#include <stdexcept>
#include <string>

namespace scatter {

/// The request is wrong: the message is one line that names what is wrong, where, and what would be right.
/// The program exits 2 on it.
struct InputError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// The request was right but the machine failed it (disk full, device lost). The program exits 1 on it.
struct RunError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

} // namespace scatter
