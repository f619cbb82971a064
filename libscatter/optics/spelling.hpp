#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Guesses at misspelt names, for error messages.
namespace scatter {

/// The known name that needs the fewest letters inserted, deleted or replaced (Levenshtein) to become the
/// word, if that is at most 2 or half its length: near enough to be meant. None for a word of 100 letters or
/// more.
[[nodiscard]] std::optional<std::string>
nearest_name(std::string_view word, const std::vector<std::string>& known);

} // namespace scatter
