# scatter_embed(SYMBOL FILE): makes <embedded/SYMBOL.hpp> for the sources of the library and of the
# validation, with
#   inline constexpr std::string_view scatter::embedded::SYMBOL
# that holds the text of FILE (relative to the project), so that an installed library needs no data folder.
function(scatter_embed symbol file)
  set(path ${PROJECT_SOURCE_DIR}/${file})
  set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${path})
  file(READ ${path} text)
  file(
    CONFIGURE
    OUTPUT ${PROJECT_BINARY_DIR}/generated/embedded/${symbol}.hpp
    CONTENT "// Made from ${file} by the build.
#pragma once
#include <string_view>
namespace scatter::embedded {
inline constexpr std::string_view ${symbol} = R\"~~~(@text@)~~~\";
}
"
    @ONLY)
  target_include_directories(scatter PRIVATE ${PROJECT_BINARY_DIR}/generated)
endfunction()
